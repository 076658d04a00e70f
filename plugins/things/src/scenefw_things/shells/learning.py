"""Training of networks that complete single objects."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import torch

from scenefw.core.batches import IndexBatch
from scenefw.core.rng import generator, torch_seed
from scenefw.kernels.cameras import camera_of, pixel_places
from scenefw.learning.checkpoint import OBJECT_SHELLS
from scenefw.learning.module import TrainingModule
from scenefw.shapes.object_shell import ENTRY, EXIT, ObjectShell
from scenefw_things.shapes.part_unions import inside
from scenefw_things.shells.batches import ObjectCrops, ObjectShellBatch, ShellPrediction, ShellSetup
from scenefw_things.shells.solid_measures import (
    Solid,
    chamfer,
    hull_solid,
    overlap,
    shell_solid,
)

if TYPE_CHECKING:
    from scenefw.core.types import Float64
    from scenefw_things.shells.protocols import ObjectShellData, ObjectShellModel

_CODES, _POINTS = 4, 10  # random streams, beside those of data
METHODS = ("shell", "footprint_hull", "visible_hull")
"""The network's best guess; hulls of visible points with their footprints on the floor, without."""


class ObjectShellLearning(TrainingModule):
    """Trains a network of shells (group `learning`); arguments are those of any training.

    Validation scores the solids of single objects, beside hulls of their visible points: Chamfer
    distance (mm, mean of both directions) and overlap of voxels of 6 mm, means over objects.
    """

    task = OBJECT_SHELLS
    model: ObjectShellModel

    def setup_with(self, data: ObjectShellData) -> ShellSetup:
        """Of how many crops codes are drawn."""
        return ShellSetup(self.model.draws(data.batch_size * data.objects))

    def predict_batch(self, batch: ObjectShellBatch) -> ShellPrediction:
        """Shells of the zero code, and of the codes of this step."""
        return self.model(batch.crops, self._codes(self.batches_seen))

    def validation_step(self, batch: IndexBatch, batch_idx: int) -> None:
        """Losses and scores of the same objects every time."""
        validation_batch = self.validation_batch(batch)
        prediction = self.model(validation_batch.crops, self._codes(0))
        values = {
            f"val/{name}": float(loss(prediction, validation_batch))
            for name, loss in self.losses.items()
        }
        truth = self.trainer.datamodule.validation_solids(batch)
        points = visible_points(validation_batch.crops)
        rows = [
            scores(
                object_shell(number, validation_batch.crops, prediction),
                points[number],
                Solid(partial(inside, parts=parts), surface),
                generator(self.seed, _POINTS, number),
            )
            for number, (parts, surface) in enumerate(truth)
        ]
        means = np.nanmean(np.array(rows), axis=0)
        for name, (distance, ratio) in zip(METHODS, means, strict=True):
            prefix = "" if name == METHODS[0] else f"{name}_"
            values |= {f"val/{prefix}chamfer_mm": distance, f"val/{prefix}iou": ratio}
        self.log_dict(values, batch_size=len(batch.indices), on_epoch=True, sync_dist=True)

    def _codes(self, step: int) -> torch.Generator:
        codes = torch.Generator()  # on the CPU: the same on every device
        codes.manual_seed(torch_seed(self.seed, _CODES, step, self.global_rank))
        return codes


def object_shell(number: int, crops: ObjectCrops, prediction: ShellPrediction) -> ObjectShell:
    """What a network says of one object; what is visible is of it."""
    depths = prediction.depths[number].double().cpu().numpy()
    amodal = (prediction.amodal[number] > 0) | crops.visible[number]
    hollow = (prediction.hollow[number] > 0).cpu().numpy()
    amodal = amodal.cpu().numpy() & (depths[EXIT] > depths[ENTRY])
    return ObjectShell(camera_of(crops.cameras, number), amodal, hollow & amodal, depths)


def visible_points(crops: ObjectCrops) -> list[Float64]:
    """Visible points (P, 3) of each object in the world (m)."""
    places = pixel_places(crops.depth, crops.cameras).double()
    return [place[shown].cpu().numpy() for place, shown in zip(places, crops.visible, strict=True)]


def scores(
    shell: ObjectShell, points: Float64, truth: Solid, rng: np.random.Generator
) -> list[tuple[float, float]]:
    """Chamfer distance (mm) and overlap of one object by each of `METHODS`.

    A method that makes no solid overlaps with nothing, and has no distance (NaN).
    """
    solids = [
        shell_solid(shell, rng) if shell.amodal.any() else None,
        hull_solid(points, rng, footprint=True),
        hull_solid(points, rng, footprint=False),
    ]
    return [
        (float("nan"), 0.0)
        if solid is None
        else (1000 * chamfer(solid.points, truth.points), overlap(solid, truth))
        for solid in solids
    ]
