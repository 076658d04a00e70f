"""Scenes as a network of sets decomposes them: objects from codes, given one view."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from scipy import ndimage

from scenefw.core.errors import ConfigError
from scenefw.core.settings import NOT_NEGATIVE, PART
from scenefw.data.batches.conditioning import condition, require_grid
from scenefw.perception.completion.suppression import chosen_objects
from scenefw.perception.steps import Objects, ObjectSet

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from torch import Tensor

    from scenefw.core.object_sets import ObjectSetPrediction
    from scenefw.core.training_protocols import TrainedOnGrid
    from scenefw.core.types import Float32
    from scenefw.perception.observation.observation import Observation
    from scenefw.perception.steps import Fits


class SetNetwork:
    """Completes partial TSDFs with a network that predicts a set of objects, each from a code.

    A network with a prior gives as many scenes as are asked for. The first is the prior's mean
    if the view decides on it, else it is drawn as the others are. A network without a prior gives
    one scene.

    Args:
        checkpoint: of the task object_sets, of a network that sees one view.
        device: where the network runs.
        min_volume: a prediction of a lower volume is no object (m^3).
        max_iou: of predictions that overlap with this IoU or more the surest stays; None: all.
        smoothing: standard deviation (voxels) of a Gaussian over distances, which are those to
            borders of voxels; 0 for none.

    Raises:
        ConfigError: a number is out of range, or the network sees whole scenes alone.
    """

    def __init__(
        self,
        checkpoint: TrainedOnGrid[Any],
        device: str = "cpu",
        min_volume: float = 3e-5,
        max_iou: float | None = 0.3,
        smoothing: float = 0.7,
    ) -> None:
        NOT_NEGATIVE.require(min_volume=min_volume, smoothing=smoothing)
        PART.require(max_iou=max_iou)
        self.device = torch.device(device)
        self.model = checkpoint.model.to(self.device).eval()
        if self.model.sees == "occupancy":
            raise ConfigError(
                "this network decomposes complete volumes, not views; give the checkpoint of a "
                "training with model.sees=view (experiment=decomposition)"
            )
        self.grid, self.metadata = checkpoint.grid, dict(checkpoint.metadata)
        self.min_volume, self.max_iou, self.smoothing = min_volume, max_iou, smoothing

    @torch.no_grad()
    def complete(
        self, fits: Fits, view: Observation, samples: int, generator: torch.Generator
    ) -> list[ObjectSet]:
        """Complete scenes, drawn where the network has a prior; fits count for nothing.

        Raises:
            InputError: the grid is not the one that the network was trained on.
        """
        require_grid(view.grid, self.grid)
        inputs = condition(view.partial, view.grid).to(self.device)
        predictions = self._predictions(inputs, samples, generator)
        return [ObjectSet(self._objects(prediction)) for prediction in predictions]

    def _predictions(
        self, inputs: Tensor, samples: int, generator: torch.Generator
    ) -> list[ObjectSetPrediction]:
        if not self.model.latent_shape:
            return [self.model.decompose(inputs)]
        shape = (len(inputs), *self.model.latent_shape)
        all_latents = torch.randn((samples, *shape), generator=generator)
        if self.model.prior_sees_view:
            all_latents[0] = 0.0
        return [self.model.sample(inputs, latents) for latents in all_latents.to(self.device)]

    def _objects(self, prediction: ObjectSetPrediction) -> Objects:
        labels = chosen_objects(prediction, 0, self.grid, self.min_volume, self.max_iou).labels
        return Objects(None, self._distances(labels > 0), labels.astype(np.int32))

    def _distances(self, inside: NDArray[np.bool_]) -> Float32:
        """Signed distances (X, Y, Z) to the border of what is inside (m), truncated."""
        limit, voxel = self.grid.truncation, self.grid.voxel_size
        if not inside.any():
            return np.full(inside.shape, limit, np.float32)
        edt = ndimage.distance_transform_edt
        distances = np.where(inside, 0.5 - edt(inside), edt(~inside) - 0.5) * voxel
        smooth = ndimage.gaussian_filter(distances, self.smoothing) if self.smoothing else distances
        smooth = np.where(smooth * distances > 0, smooth, distances)  # what is thin stays inside
        return np.clip(smooth, -limit, limit).astype(np.float32)
