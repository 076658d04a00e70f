"""Matching of predicted to true objects, 16 scenes with 8 of each, and the loss beside it.

The first peer computes the binary cross entropy of all pairs, a volume each, one scene at a time,
as a whole batch of them takes 8 GB; the second the same costs by one product of matrices, with the
true objects as volumes. Both then assign with SciPy, as ours does.
"""

import torch
from scipy.optimize import linear_sum_assignment
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits, softplus

from benchmarks.harness import Job, Timed
from scenefw.core.types import GridSpec
from scenefw.data.stacks import StackScenes
from scenefw.matching.object_sets import matched_objects
from scenefw.representations.volumes import scene_volumes

SCENES, OBJECTS = 16, 8
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


JOBS = [
    Job(
        f"matching of {SCENES} x {OBJECTS} x {OBJECTS} objects, 64^3",
        ours,
        {"cross entropy of all pairs": pairwise, "product of matrices": product},
        repeats=9,
        seconds=6.0,
    )
]
