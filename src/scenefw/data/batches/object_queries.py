"""The data module of decoders of sets: partial views, seen points and distances to objects."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from scenefw.core.queried_sets import VOLUME, ObjectQueryBatch
from scenefw.core.settings import COUNT, POSITIVE
from scenefw.data.batches.conditioning import condition
from scenefw.data.batches.places_about import CHANCES, placed_about, require_places
from scenefw.data.batches.scene_batches import SceneBatches
from scenefw.data.batches.view_samples import POINTS_OF_VIEW, view_facts
from scenefw.data.batches.visible_points import seen_points
from scenefw.kernels.transfer import to_device
from scenefw.noise.frames import described

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.batches import IndexBatch
    from scenefw.core.types import GridSpec
    from scenefw.data.batches.stacks import StackScenes
    from scenefw.data.batches.views import ViewMaker

# Random streams, beside that of the order of scenes
_VIEWS, _VALIDATION = 2, 3


class ObjectQueryViews(SceneBatches):
    """Makes views of the scenes of two splits, with what decoders of sets learn (group `dataset`).

    No volume is ever stored. View and motion of scene i in epoch e depend on (seed, e, i) alone.

    Args:
        views: moves scenes and makes a view of each.
        path: the `.npz` of a data set, the name of a shipped one, or several.
        limit: at most this many training scenes; None means all.
        validation_limit: at most this many validation scenes; None means all.
        batch_size: scenes per step.
        seed: seed of the order of scenes, and of views.
        distinct_batches: train on this many batches again and again, views and all; None means all.
        points: that are taken of what each view shows.
        places: about each object, at which distances are learnt; half of them near its surface.
        near: how near (m, standard deviation).

    Raises:
        ConfigError: a number that isn't positive, or an odd number of places.
    """

    sees = VOLUME

    def __init__(
        self,
        views: ViewMaker,
        path: str | Sequence[str] | None = None,
        limit: int | None = None,
        validation_limit: int | None = 64,
        batch_size: int = 8,
        seed: int = 0,
        distinct_batches: int | None = None,
        points: int = POINTS_OF_VIEW,
        places: int = 256,
        near: float = 0.01,
    ) -> None:
        super().__init__(path, limit, validation_limit, batch_size, seed, distinct_batches)
        COUNT.require(points=points)
        POSITIVE.require(near=near)
        require_places(places)
        self.views = views
        self.points, self.places, self.near = points, places, near

    @property
    def grid(self) -> GridSpec:
        """The voxel grid of views."""
        return self.views.grid

    def facts(self) -> dict[str, Any]:
        """Facts about the data, and how many points networks are shown."""
        return {**super().facts(), **view_facts(self.points)}

    @property
    def noise_words(self) -> str | list[str]:
        """What disturbs the views."""
        return described(self.views.noise)

    def training_batch(self, batch: IndexBatch, device: torch.device) -> ObjectQueryBatch:
        """Views and objects of scenes in an epoch."""
        return self._make(self.scenes, batch, device, _VIEWS)

    def validation_batch(self, batch: IndexBatch, device: torch.device) -> ObjectQueryBatch:
        """The same views every time."""
        return self._make(self.validation_scenes, batch, device, _VALIDATION)

    @torch.no_grad()
    def _make(
        self, scenes: StackScenes, batch: IndexBatch, device: torch.device, stream: int
    ) -> ObjectQueryBatch:
        parameters = scenes.parameters(batch.indices, device)
        streams = self.streams(batch, stream)
        to_view, to_points, to_places = streams.split(3)
        slots = parameters.present.shape[1]
        arrays = [
            to_points.uniform(self.points).astype(np.float32),
            to_places.uniform(slots * self.places * CHANCES).astype(np.float32),
        ]
        at_points, at_places = to_device(arrays, device)
        views = self.views.make(parameters, to_view)
        objects = views.superquadrics
        points, valid = seen_points(views.depth, views.cameras, self.grid, at_points)
        chances = at_places.view(len(points), slots, self.places, CHANCES)
        places, distances = placed_about(objects, chances, self.near)
        view = condition(views.partial, self.grid)
        return ObjectQueryBatch(view, points, valid, objects, places, distances)
