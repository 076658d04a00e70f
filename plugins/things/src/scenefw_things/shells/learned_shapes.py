"""Shapes that a network tells from crops about single objects."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import torch

from scenefw.core.lazy_mapping import LazyMapping
from scenefw.core.part_views import PartViewBatch
from scenefw.kernels.cameras import camera_of, stack_cameras
from scenefw.perception.observation.observation import Observation
from scenefw.shapes.object_shell import ENTRY, EXIT, ObjectShell
from scenefw_things.shells.batches import ObjectCrops
from scenefw_things.shells.crops import CropShape, crop, references, windows

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from scenefw.core.training_protocols import Trained
    from scenefw.core.types import Int32
    from scenefw.perception.observation.views import View
    from scenefw.perception.steps import ObjectSet
    from scenefw_things.shells.batches import ShellPrediction
    from scenefw_things.shells.protocols import ObjectShellModel

_MIN_THICKNESS = 2.0  # voxels of its mesh, of what is visible: thinner, a mesh has holes
_SIGMAS = 3.0  # deviations of a measured depth within which the visible surface lies


class LearnedShapes:
    """Adds shells of objects: where rays enter and leave them, as a network tells it.

    What is visible stays within the noise of the sensor, and nothing lies before what was measured
    or below the floor. The first hypothesis is the network's best guess, others follow codes that
    are drawn for all objects; which rays pass a hollow, the best guess says in all of them. An
    object of which too little is visible has no shell.

    Args:
        checkpoint: of a network of shells.

    Raises:
        ConfigError: the weights don't say which crops they learnt from.
    """

    def __init__(self, checkpoint: Trained[ObjectShellModel]) -> None:
        self.model: ObjectShellModel = checkpoint.model
        self.metadata = dict(checkpoint.metadata)
        self.crops = CropShape.of(checkpoint.metadata)

    def beside(
        self, sets: Sequence[ObjectSet], view: View, generator: torch.Generator
    ) -> list[ObjectSet]:
        """The best guess in the first hypothesis, draws of all objects together in others."""
        masks, samples = sets[0].objects.pixels, len(sets)
        if not isinstance(view, Observation) or not masks.any():
            return list(sets)
        labels = [int(label) for label in np.unique(masks[masks > 0])]
        crops = self._crops(masks, labels, view)
        rows = (crops.visible.sum(dim=(1, 2)) >= self.crops.min_pixels).nonzero()[:, 0].tolist()
        if not rows:
            return list(sets)
        codes = torch.randn(samples, len(labels), self.model.latent_size, generator=generator)
        codes[0] = 0
        best = self._sample(crops, codes[:1])
        guesses = {labels[row]: _shell(best, row, crops, row, view) for row in rows}
        guesses = {label: shell for label, shell in guesses.items() if shell.amodal.any()}

        def drawn(label: int) -> list[ObjectShell]:
            row = labels.index(label)
            crop_of_object = crops.row(row)
            prediction = self._sample(crop_of_object, codes[:, row : row + 1])
            shells = [_shell(prediction, n, crop_of_object, 0, view) for n in range(samples)]
            return [shell if shell.amodal.any() else guesses[label] for shell in shells]

        draws = LazyMapping(guesses, drawn)  # most objects keep their superquadrics

        def shells_of(number: int) -> Mapping[int, ObjectShell]:
            return LazyMapping(guesses, lambda label: draws[label][number]) if number else guesses

        return [replace(item, shells=shells_of(number)) for number, item in enumerate(sets)]

    @torch.no_grad()
    def _sample(self, crops: ObjectCrops, codes: torch.Tensor) -> ShellPrediction:
        """Shells of N crops and S codes (S, N, latent_size) of each, the best guesses first."""
        return self.model.sample(crops, codes.to(crops.depth.device))

    def _crops(self, masks: Int32, labels: list[int], view: Observation) -> ObjectCrops:
        """Crops about objects, with obstacles among what is beside them."""
        device = next(self.model.parameters()).device  # type: ignore[attr-defined]
        owners = torch.from_numpy(masks.astype(np.int32))
        if view.workspace is not None:
            for region in view.workspace.obstacles:
                owners[torch.from_numpy(region.pixels) & (owners == 0)] = int(masks.max()) + 1
        depth = torch.from_numpy(np.ascontiguousarray(np.nan_to_num(view.depth), np.float32))
        colour = None
        if view.colour is not None:
            colour = torch.tensor(view.colour).permute(2, 0, 1)[None].to(device) / 255
        views = PartViewBatch(
            depth[None].to(device), owners[None].to(device),
            stack_cameras([view.camera], device), None, colour,
        )  # fmt: skip
        numbers = torch.tensor(labels, dtype=torch.int32, device=device)
        visible = (views.owners == numbers[:, None, None]) & (views.depth > 0)
        count = visible.sum(dim=(1, 2)).clamp_min(1)
        distance = torch.where(visible, views.depth, 0.0).sum(dim=(1, 2)) / count
        min_side = self.crops.min_width * view.camera.fx / distance.clamp_min(1e-3)
        shifts = torch.zeros(len(labels), 2, device=device)
        squares = windows(visible, torch.full_like(distance, self.crops.margin), shifts, min_side)
        rows = torch.zeros(len(labels), dtype=torch.int64, device=device)
        return crop(views, rows, numbers, squares, self.crops.resolution)


def _shell(
    prediction: ShellPrediction, number: int, crops: ObjectCrops, row: int, view: Observation
) -> ObjectShell:
    """A predicted shell, as far as the view allows it.

    Args:
        prediction: of the crops, hypothesis after hypothesis, the best guesses first.
        number: of the shell in it.
        crops: of the objects.
        row: the object's.
        view: says how noisy depth is.
    """
    amodal = (prediction.amodal[number] > 0).cpu().numpy()
    hollow = (prediction.hollow[row] > 0).cpu().numpy()  # drawn ones are thin skins of solids
    depths = prediction.depths[number].double().cpu().numpy()
    measured = crops.depth[row].double().cpu().numpy()
    visible = crops.visible[row].cpu().numpy()
    reference, width = (float(values[row]) for values in references(crops))
    depths = depths.clip(reference - width, reference + width)  # no object is larger than its crop
    reach = _SIGMAS * view.noise.at(measured)
    latest = np.where(visible, measured + reach, np.inf)
    depths[ENTRY] = depths[ENTRY].clip(measured - reach, latest)
    shell = ObjectShell(camera_of(crops.cameras, row), amodal, hollow & amodal, depths)
    if not amodal.any():
        return shell
    thick = np.maximum(depths[EXIT], depths[ENTRY] + _MIN_THICKNESS * shell.voxel)
    depths[EXIT] = np.where(visible, thick, depths[EXIT])
    amodal = amodal & (depths[EXIT] > depths[ENTRY])
    return replace(shell, amodal=amodal, hollow=hollow & amodal, depths=depths)
