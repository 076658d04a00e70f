"""Matching of predicted to true objects, 16 scenes with 8 of each, and training steps with it.

Of the matching, the first peer computes the binary cross entropy of all pairs, a volume each, one
scene at a time, as a whole batch of them takes 8 GB; the second the same costs by one product of
matrices, with the true objects as volumes. Both then assign with SciPy, as ours does. Training
steps, 8 scenes at 64^3 in bfloat16, forward, matching, loss and backward, stand beside that of the
network of chapter 5.
"""

import torch
from scipy.optimize import linear_sum_assignment
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits, softplus

from benchmarks.harness import Job, Timed
from benchmarks.training_data import DEVICE, finished, network, views
from benchmarks.training_data import SCENES as TRAINED
from scenefw.core.object_sets import ObjectSetBatch
from scenefw.core.rng import Streams
from scenefw.core.types import GridSpec
from scenefw.data.batches.object_sets import object_set_batch
from scenefw.data.batches.stacks import StackScenes
from scenefw.learning.object_sets import matched
from scenefw.losses.set_bce import SetBinaryCrossEntropy
from scenefw.matching.object_sets import matched_objects
from scenefw.models.set_autoencoder import SetAutoencoder
from scenefw.models.set_placed import PlacedSetAutoencoder
from scenefw.models.set_vae import SetVAE
from scenefw.representations.volumes import scene_volumes

SCENES, OBJECTS = 16, 8
STEP = 8  # scenes
GRID = GridSpec()


def sets() -> tuple[Tensor, Tensor, Tensor]:
    """Logits, labels and presence: stacks of 4 to 8 objects, predictions of noise around them."""
    parameters = StackScenes("large_stacks", "val", SCENES).parameters(list(range(SCENES)))
    instances = scene_volumes(parameters, GRID).instances
    noise = torch.Generator().manual_seed(0)
    logits = torch.randn(SCENES, OBJECTS, *GRID.shape, generator=noise) - 4
    return logits, instances, parameters.present


def truths(instances: Tensor) -> Tensor:
    """One volume (B, M, V) per object."""
    labels = torch.arange(1, OBJECTS + 1)[None, :, None]
    return (instances.flatten(1)[:, None] == labels).float()


def assigned(costs: Tensor) -> list[object]:
    """Of every scene."""
    return [linear_sum_assignment(cost) for cost in costs.numpy()]


def ours() -> Timed:
    """Sums over the voxels of objects."""
    logits, instances, present = sets()
    return lambda: matched_objects(logits, instances, present)


def pairwise() -> Timed:
    """A volume per pair."""
    logits, instances, _ = sets()

    def run() -> object:
        rows = []
        for predicted, true in zip(logits.flatten(2), truths(instances), strict=True):
            shape = (OBJECTS, OBJECTS, predicted.shape[1])
            pairs = predicted[:, None].expand(shape), true[None].expand(shape)
            rows.append(binary_cross_entropy_with_logits(*pairs, reduction="none").sum(dim=2))
        return assigned(torch.stack(rows))

    return run


def product() -> Timed:
    """The cross entropy as a product of matrices."""
    logits, instances, _ = sets()

    def run() -> object:
        predicted = logits.flatten(2)
        shared = predicted @ truths(instances).transpose(1, 2)
        return assigned(softplus(predicted).sum(dim=2)[..., None] - shared)

    return run


def views_and_objects() -> ObjectSetBatch:
    """A batch of stacks of 4 to 8 objects."""
    indices = torch.arange(STEP)
    parameters = StackScenes("large_stacks", limit=STEP).parameters(indices, DEVICE)
    made = views(noise=False).make(parameters, Streams.of(0, 2, indices=indices.numpy()))
    return object_set_batch(made, GRID)


def step(model: SetAutoencoder | PlacedSetAutoencoder | SetVAE) -> Timed:
    """A step of a network of sets."""
    batch, loss = views_and_objects(), SetBinaryCrossEntropy()
    model = model.to(DEVICE).to(memory_format=torch.channels_last_3d)

    def run() -> None:
        with torch.autocast(DEVICE, torch.bfloat16):
            total = loss(matched(model(batch, torch.Generator()), batch), batch)
        total.backward()
        model.zero_grad()

    return finished(run)


def autoencoder() -> Timed:
    """Of model=set_autoencoder."""
    return step(SetAutoencoder(GRID.resolution))


def placed() -> Timed:
    """Of model=set_placed, with as many predictions."""
    return step(PlacedSetAutoencoder(GRID.resolution, slots=OBJECTS))


def vae() -> Timed:
    """Of model=set_vae."""
    return step(SetVAE(GRID.resolution))


_STEP = f"step of the network of chapter 5, {TRAINED} scenes"
JOBS = [
    Job(
        f"matching of {SCENES} x {OBJECTS} x {OBJECTS} objects, 64^3",
        ours,
        {"cross entropy of all pairs": pairwise, "product of matrices": product},
        repeats=9,
        seconds=6.0,
    ),
    Job("step of the autoencoder of sets, 64^3", autoencoder, {_STEP: network}, repeats=5),
    Job(
        "step of sets in boxes, 64^3",
        placed,
        {"step of the autoencoder of sets": autoencoder},
        repeats=5,
    ),
    Job("step of the VAE of sets, 64^3", vae, {_STEP: network}, repeats=5),
]
