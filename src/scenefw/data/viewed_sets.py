"""The data module of decoders of sets: partial views, seen points and distances to objects."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from scenefw.core.errors import SettingError
from scenefw.core.queried_sets import ViewedSetBatch
from scenefw.core.settings import COUNT, POSITIVE
from scenefw.data.conditioning import condition
from scenefw.data.scene_batches import SceneBatches
from scenefw.data.seen_points import seen_points
from scenefw.data.view_samples import POINTS_OF_VIEW, view_facts
from scenefw.kernels.transfer import to_device
from scenefw.noise.frames import described
from scenefw.shapes.radial_distance import radial_distance

if TYPE_CHECKING:
    from collections.abc import Sequence

    from torch import Tensor

    from scenefw.core.batches import IndexBatch, SceneParameters
    from scenefw.core.types import GridSpec
    from scenefw.data.stacks import StackScenes
    from scenefw.data.views import ViewMaker

# Random streams, beside that of the order of scenes
_VIEWS, _VALIDATION = 2, 3
_CHANCES = 7  # of each place: axis, side, three coordinates, two for its distance
_ROOM = (1.5, 0.02)  # the box about an object in which places lie: times its half-axes, plus (m)


class ViewedSets(SceneBatches):
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
        if places < 2 or places % 2:
            raise SettingError("places", places, "an even number of 2 or more")
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

    def training_batch(self, batch: IndexBatch, device: torch.device) -> ViewedSetBatch:
        """Views and objects of scenes in an epoch."""
        return self._make(self.scenes, batch, device, _VIEWS)

    def validation_batch(self, batch: IndexBatch, device: torch.device) -> ViewedSetBatch:
        """The same views every time."""
        return self._make(self.validation_scenes, batch, device, _VALIDATION)

    @torch.no_grad()
    def _make(
        self, scenes: StackScenes, batch: IndexBatch, device: torch.device, stream: int
    ) -> ViewedSetBatch:
        parameters = scenes.parameters(batch.indices, device)
        streams = self.streams(batch, stream)
        to_view, to_points, to_places = streams.split(3)
        slots = parameters.present.shape[1]
        drawn = [
            to_points.uniform(self.points).astype(np.float32),
            to_places.uniform(slots * self.places * _CHANCES).astype(np.float32),
        ]
        at_points, at_places = to_device(drawn, device)
        made = self.views.make(parameters, to_view)
        moved = made.superquadrics
        points, seen = seen_points(made.depth, made.cameras, self.grid, at_points)
        chances = at_places.view(len(points), slots, self.places, _CHANCES)
        places, distances = placed_about(moved, chances, self.near)
        view = condition(made.partial, self.grid)
        return ViewedSetBatch(view, points, seen, moved, places, distances)


def placed_about(scenes: SceneParameters, chances: Tensor, near: float) -> tuple[Tensor, Tensor]:
    """Places (B, M, Q, 3) about objects (m, world), and distances (B, M, Q) to them (m).

    The first half lie near points of the surface that lie behind random ones of the six faces of a
    box about the object, the others anywhere in a somewhat larger box.

    Args:
        scenes: of up to M objects.
        chances: (B, M, Q, 7) uniform in [0, 1).
        near: standard deviation of the distance of the first half from the surface (m).
    """
    half_axes, exponents = scenes.half_axes[:, :, None], scenes.exponents[:, :, None]
    local = 2 * chances[..., 2:5] - 1
    axis = (3 * chances[..., :1]).long().clamp_max(2)
    on_box = local.scatter(-1, axis, torch.where(chances[..., 1:2] < 0.5, -1.0, 1.0)) * half_axes
    away = torch.linalg.vector_norm(on_box, dim=-1).clamp_min(1e-6)
    beyond = radial_distance(on_box, half_axes, exponents)
    normal = (-2 * (1 - chances[..., 5]).clamp_min(1e-7).log()).sqrt()
    shift = near * normal * (2 * torch.pi * chances[..., 6]).cos()
    close = on_box * (1 + (shift - beyond) / away)[..., None]
    factor, room = _ROOM
    half = chances.shape[2] // 2
    wide = local * (factor * half_axes + room)
    local = torch.cat([close[:, :, :half], wide[:, :, half:]], dim=2)
    places = torch.einsum("bmij,bmqj->bmqi", scenes.rotations, local) + scenes.positions[:, :, None]
    there = scenes.present[:, :, None]
    distances = torch.where(there, radial_distance(local, half_axes, exponents), 0.0)
    return torch.where(there[..., None], places, 0.0), distances
