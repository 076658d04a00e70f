"""Does a CUDA device compute what the CPU does? One training step's data, prediction and losses.

    python -m benchmarks.check_device [experiment=simstack scale=thesis ...]
    python -m benchmarks.check_device experiment=label_views scale=thesis
    python -m benchmarks.check_device experiment=part_affinity
    python -m benchmarks.check_device experiment=set_extents

Volumes, depth and partial TSDF, or colour, distance and labels, or what the networks of parts and
of sets see, are compared where rounding doesn't decide which surface is hit: a share of the values
may differ by more than the tolerance. Exit status 1 if anything is off.
"""

import sys

import numpy as np
import torch
from torch import Tensor

from scenefw import config, plugins
from scenefw.core.batches import IndexBatch
from scenefw.core.rng import Streams
from scenefw.data.batches.conditioning import shape_instance_batch
from scenefw.data.batches.part_views import PartViews
from scenefw.data.batches.set_flow import SetFlowViews
from scenefw.data.batches.stacks import StackScenes

SCENES = 4
TOLERANCES = {  # metres, or units of a loss; and the share of values that may be farther off
    "tsdf": (1e-4, 1e-3),
    "votes": (1e-3, 1e-3),
    "depth": (1e-3, 5e-3),
    "partial": (2e-3, 1e-2),
    "observed": (0.5, 1e-2),
    "colour": (2e-2, 1e-2),
    "distance": (1e-4, 5e-3),
    "labels": (0.5, 1e-3),
    "points": (1e-3, 1e-2),
    "losses": (2e-2, 0.0),  # relative; float32 with TF32 off, each device with its own volumes
}


def step(settings, device) -> dict[str, Tensor]:
    """What a training step makes of some scenes, back on the CPU; noise is left out."""
    from hydra.utils import instantiate

    from scenefw_tabletops.data.segmentation import SegmentationData  # once plugins are found

    torch.manual_seed(0)
    learning = instantiate(settings.learning, _convert_="all")
    data = instantiate(settings.dataset, _convert_="all")
    kinds = {SegmentationData: labelled, PartViews: in_parts, SetFlowViews: as_sets}
    found = kinds.get(type(data), completed)(learning, data, device)
    return {name: value.detach().float().cpu() for name, value in found.items()}


def labelled(learning, data, device) -> dict[str, Tensor]:
    """Samples of a labelling network and its losses; where nothing was measured distance is -1."""
    chosen = IndexBatch(0, torch.arange(0, len(data.train), len(data.train) // SCENES)[:SCENES])
    batch = data.training_batch(chosen, torch.device(device))
    model = learning.model.to(device).eval()
    scores = model(batch.colour, batch.distance)
    losses = torch.stack([loss(scores, batch).detach() for loss in learning.losses.values()])
    distance = batch.distance.nan_to_num(-1.0)
    return {"colour": batch.colour, "distance": distance, "labels": batch.labels, "losses": losses}


def in_parts(learning, data, device) -> dict[str, Tensor]:
    """Depth images, which object each pixel shows, and losses of a network of affinities."""
    batch = data.training_batch(IndexBatch(0, torch.arange(4 * SCENES)), torch.device(device))
    scores = learning.model.to(device).eval()(batch.depth, batch.cameras)
    losses = torch.stack([loss(scores, batch).detach() for loss in learning.losses.values()])
    return {"depth": batch.depth, "labels": batch.owners, "losses": losses}


def as_sets(learning, data, device) -> dict[str, Tensor]:
    """Points of seen objects, and losses of a flow of sets."""
    batch = data.training_batch(IndexBatch(0, torch.arange(16 * SCENES)), torch.device(device))
    prediction = learning.model.to(device)(batch, torch.Generator().manual_seed(0))
    losses = torch.stack([loss(prediction, batch).detach() for loss in learning.losses.values()])
    return {"points": batch.points, "losses": losses}


def completed(learning, data, device) -> dict[str, Tensor]:
    """Volumes, views and losses of a shape-and-instance network."""
    scenes = StackScenes(split="train", limit=SCENES)
    streams = Streams.of(0, 2, 0, indices=np.arange(SCENES))
    made = data.views.make(scenes.parameters(list(range(SCENES)), device), streams)
    batch = shape_instance_batch(made.partial, made.scenes, data.representations)
    model = learning.model.to(device)
    prediction = model(batch, torch.Generator().manual_seed(0))
    losses = torch.stack([loss(prediction, batch).detach() for loss in learning.losses.values()])
    return {
        "tsdf": made.volumes.tsdf,
        "votes": made.volumes.votes,
        "depth": made.depth,
        "partial": made.partial.distance,
        "observed": made.partial.observed.float(),
        "losses": losses,
    }


def compare(expected: dict[str, Tensor], found: dict[str, Tensor]) -> bool:
    """Prints one line per quantity; whether all are within their tolerances."""
    fine = True
    for name in expected:
        tolerance, share = TOLERANCES[name]
        off = (found[name] - expected[name]).abs()
        if name == "losses":
            off = off / expected[name].abs().clamp(min=0.1)
        apart = float((~(off <= tolerance)).float().mean())  # NaN counts
        good = apart <= share
        fine &= good
        print(
            f"{name:<9} largest difference {float(off.max()):.2e}, {apart:.2%} beyond "
            f"{tolerance:g} (at most {share:.2%}): {'ok' if good else 'WRONG'}"
        )
    return fine


def main() -> None:
    """The command line."""
    plugins.activate()
    words = sys.argv[1:] or ["experiment=simstack"]
    few = [f"size.tables={SCENES}", "size.validation_tables=1"]
    quiet = ["noise=none", "noise_per_scene=none"]
    words = [word for word in words if not word.startswith("noise")]
    settings = config.compose([*words, *few, *quiet])
    if "noise" in settings.dataset:
        settings.dataset.noise = {}  # of experiments that train with their own
    torch.backends.cuda.matmul.allow_tf32 = torch.backends.cudnn.allow_tf32 = False
    if not torch.cuda.is_available():
        print("error: torch sees no CUDA device", file=sys.stderr)
        sys.exit(2)
    print(torch.cuda.get_device_name())
    sys.exit(0 if compare(step(settings, "cpu"), step(settings, "cuda")) else 1)


if __name__ == "__main__":
    main()
