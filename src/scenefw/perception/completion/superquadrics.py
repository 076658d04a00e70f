"""Another reconstructor's scenes, with superquadrics for the objects that they explain."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from scipy.ndimage import binary_dilation

from scenefw.core.batches import SceneParameters
from scenefw.core.settings import COUNT, NOT_NEGATIVE, POSITIVE, SHARE
from scenefw.core.types import PlacedShape
from scenefw.fitting.placed import shape_of
from scenefw.perception.completion.vessels import with_vessels
from scenefw.perception.evidence.gathering import EvidenceOfView, View, seen_free
from scenefw.perception.evidence.visible_instances import seen_instances
from scenefw.perception.observation.free_space import (
    SEEN_THROUGH,
    places_in,
    seen_through,
    surely_free,
)
from scenefw.perception.observation.mixed_pixels import mixed_pixels
from scenefw.perception.observation.points import world_points
from scenefw.perception.observation.view_frames import seen_frames
from scenefw.representations.volumes import scene_volumes

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.random import Generator
    from torch import Tensor

    from scenefw.core.batches import Completion, PartialTSDF
    from scenefw.core.evidence import Evidence, FittedSuperquadric
    from scenefw.core.protocols import ShapeFit
    from scenefw.core.types import Float32, GridSpec, Int32
    from scenefw.fitting.vessels import FittedVessel
    from scenefw.perception.completion.vessels import Vessels
    from scenefw.perception.grouping.relabelling import Completing
    from scenefw.perception.segmentation.edge_restoration import RestoredEdges
    from scenefw.postprocessing.confidence import Calibration

_WITHIN = 0.98  # share of seen points in the grid
_REACH = 4  # voxels around what stays whose distances stay too


class Fitted:
    """Replaces predicted objects by superquadrics that explain the view (thesis eqs 5.8 to 5.12).

    Each object is fitted to its seen points, with the predicted surface as a weak hint where it
    is hidden, such that it contains nothing that was seen free, no point of another object, and
    nothing below the floor. An object that no superquadric explains, or only one that lies where
    the view sees through, keeps its predicted volume.
    Where a part of the image has no prediction, it becomes an object if a superquadric explains it.
    Objects into which the view sees may become vessels, the same in all samples.

    Args:
        inner: makes the scenes.
        fit: of superquadrics to evidence.
        evidence: what a view says about an object.
        near: seen points up to this far from the surface are explained (m).
        explained: share of seen points that a superquadric must explain to be taken.
        least: seen points that an object must have to be fitted.
        lowest: how high above the floor what was not predicted must reach to be an object (m).
        vessels: says which objects are hollow; None: none are.
        edges: restores those of the images first; None: images stay as they are.
        drawn: the first sample is the best fit, further ones are drawn; without it, all are best.

    Raises:
        ConfigError: a share outside 0..1, or another number that isn't positive.
    """

    calibration: Calibration | None = None

    def __init__(
        self,
        inner: Completing,
        fit: ShapeFit,
        evidence: EvidenceOfView,
        near: float = 0.006,
        explained: float = 0.75,
        least: int = 60,
        lowest: float = 0.015,
        vessels: Vessels | None = None,
        edges: RestoredEdges | None = None,
        *,
        drawn: bool = True,
    ) -> None:
        POSITIVE.require(near=near)
        SHARE.require(explained=explained)
        COUNT.require(least=least)
        NOT_NEGATIVE.require(lowest=lowest)
        self.inner, self.fit, self.evidence = inner, fit, evidence
        self.near, self.explained, self.least, self.lowest = near, explained, least, lowest
        self.vessels, self.edges = vessels, edges
        self.grid, self.metadata, self.drawn = inner.grid, inner.metadata, drawn

    def complete(
        self, partial: PartialTSDF, grid: GridSpec, samples: int, generator: torch.Generator
    ) -> list[Completion]:
        """Complete scenes of sharp objects.

        Raises:
            InputError: the partial TSDF came without its depth images.
        """
        partial = partial if self.edges is None else self.edges.of(partial, grid)
        frames = seen_frames(partial, "a fit")
        points = [world_points(frame) for frame in frames]
        eyes = [frame.camera.T_world_camera[:3, 3] for frame in frames]
        free = seen_free(partial, grid)
        scenes = self.inner.complete(partial, grid, samples, generator)
        seed = int(torch.randint(2**62, (1,), generator=generator)) if self.drawn else 0
        random = np.random.default_rng(seed)

        def sharpened(scene: Completion, count: int) -> list[Completion]:
            made = self._sharpened(
                scene, points, eyes, free, grid, count if self.drawn else 1, random
            )
            return made if self.drawn else made * count

        return each_drawn(scenes, sharpened)

    def _sharpened(
        self,
        scene: Completion,
        points: Sequence[Any],
        eyes: Sequence[Any],
        free: Any,
        grid: GridSpec,
        count: int,
        random: Generator,
    ) -> list[Completion]:
        """The scene with the best superquadrics, and then with drawn ones."""
        tsdf, instances = scene.tsdf.cpu().numpy(), scene.instances.cpu().numpy()
        drawn: list[list[tuple[View, dict[int, FittedSuperquadric]]]] = [[] for _ in range(count)]
        hollow = []
        for i, seen in enumerate(points):
            masks = (
                seen_instances(instances[i], seen, grid, seen[..., 2] > 0)
                if scene.masks is None
                else scene.masks[i].cpu().numpy()
            )
            mixed = mixed_pixels(seen, eyes[i])
            view = View(seen, masks, tsdf[i], instances[i], free[i], grid, eyes[i], mixed)
            draws = self.superquadrics(view, count, random)
            hollow.append(self.hollow(view, draws[0]))
            for views, found in zip(drawn, draws, strict=True):
                views.append((view, {k: one for k, one in found.items() if k not in hollow[i]}))
        return [with_superquadrics(scene, views, hollow) for views in drawn]

    def superquadrics(
        self, view: View, count: int = 1, random: Generator | None = None
    ) -> list[dict[int, FittedSuperquadric]]:
        """Objects that a superquadric explains, by label; also where nothing was predicted.

        Args:
            view: with the predicted volumes.
            count: of results: the best one, then draws.
            random: for the draws.
        """
        enough = self._enough(view)
        given = list(enough.values())
        draws = [self.fit.fit(given)] if random is None else self.fit.draws(given, count, random)
        clear = surely_free(view)
        return [
            {
                label: one
                for (label, seen), one in zip(enough.items(), draw, strict=True)
                if self._agrees(one, seen, clear)
            }
            for draw in draws
        ]

    def hollow(
        self, view: View, found: Mapping[int, FittedSuperquadric]
    ) -> dict[int, FittedVessel]:
        """Objects that are vessels, by label, of which some are in `found` as superquadrics."""
        if self.vessels is None:
            return {}
        return self.vessels.found(view, self._enough(view), found)

    def _enough(self, view: View) -> dict[int, Evidence]:
        """Evidence of objects of which enough is seen, by label."""
        labels = np.union1d(view.instances[view.instances > 0], view.masks[view.masks > 0])
        evidence = {
            label: self.evidence.of(label, view)
            for label in labels.astype(int).tolist()
            if (view.instances == label).any() or self._may_be_new(label, view)
        }
        return {k: one for k, one in evidence.items() if self._seen(one).sum() >= self.least}

    def _may_be_new(self, label: int, view: View) -> bool:
        """Whether what is seen without a prediction stands in the grid and above the floor."""
        seen = view.points[view.masks == label]
        voxels = view.grid.to_voxels(seen)
        inside = ((voxels > 0) & (voxels < view.grid.resolution - 1)).all(axis=-1)
        return bool(inside.mean() > _WITHIN and np.quantile(seen[:, 2], 0.95) > self.lowest)

    def _seen(self, evidence: Evidence) -> Any:
        return evidence.sigmas == self.evidence.seen_sigma

    def _agrees(self, fitted: FittedSuperquadric, evidence: Evidence, view: View) -> bool:
        """Whether it explains what is seen of the object, and isn't where the view sees through."""
        close = np.abs(fitted.distances[self._seen(evidence)]) < self.near
        if close.mean() < self.explained:
            return False
        return seen_through(places_in(fitted), view) <= SEEN_THROUGH


def each_drawn(
    scenes: Sequence[Completion], draw: Callable[[Completion, int], list[Completion]]
) -> list[Completion]:
    """Scenes changed by a method whose first result is its best and whose others are drawn.

    The first scene gets the best one, all others get drawn ones; a scene that stands several times,
    as of a method without samples, is given once.

    Args:
        scenes: to change.
        draw: from a scene and the number of results to the results.
    """
    places: dict[int, list[int]] = {}
    for place, scene in enumerate(scenes):
        places.setdefault(id(scene), []).append(place)
    changed = list(scenes)
    for where in places.values():
        first = int(where[0] > 0)  # the best one is left out
        for place, one in zip(
            where, draw(scenes[where[0]], len(where) + first)[first:], strict=True
        ):
            changed[place] = one
    return changed


def with_superquadrics(
    scene: Completion,
    views: Sequence[tuple[View, Mapping[int, FittedSuperquadric]]],
    vessels: Sequence[Mapping[int, FittedVessel]] | None = None,
) -> Completion:
    """The scene with the superquadrics that were found in each view, by label.

    Args:
        scene: of these views.
        views: each with what was found.
        vessels: likewise the vessels found in each; None: none were.
    """
    vessels = [{} for _ in views] if vessels is None else vessels
    rows = [
        with_vessels(hollow, *composed(found, view), view)
        for (view, found), hollow in zip(views, vessels, strict=True)
    ]
    device = scene.tsdf.device
    return replace(
        scene,
        tsdf=torch.from_numpy(np.stack([row[0] for row in rows])).to(device),
        instances=torch.from_numpy(np.stack([row[1] for row in rows])).to(device),
        placed=tuple(
            {label: _placed(one) for label, one in found.items()}
            | {label: PlacedShape(one.shape, one.pose) for label, one in hollow.items()}
            for (_, found), hollow in zip(views, vessels, strict=True)
        ),
    )


def composed(superquadrics: Mapping[int, FittedSuperquadric], view: View) -> tuple[Float32, Int32]:
    """TSDF and instances (X, Y, Z) of superquadrics, and of the objects that stay as they are.

    Args:
        superquadrics: by label.
        view: with the predicted volumes.
    """
    kept = np.where(np.isin(view.instances, list(superquadrics)), 0, view.instances)
    outside = np.full_like(view.tsdf, view.grid.truncation)
    around = binary_dilation(kept > 0, iterations=_REACH) & (view.instances == 0)
    tsdf = np.where((kept > 0) | around, view.tsdf, outside)
    instances = kept
    if superquadrics:
        labels = np.array(list(superquadrics), np.int32)
        volumes = scene_volumes(_parameters(list(superquadrics.values())), view.grid)
        sharp, owner = volumes.tsdf[0, 0].numpy(), volumes.instances[0].numpy()
        closer = sharp < tsdf
        instances = np.where(
            closer & (owner > 0), labels[np.maximum(owner - 1, 0)], np.where(closer, 0, instances)
        )
        tsdf = np.minimum(tsdf, sharp)
    return tsdf.astype(np.float32), np.where(tsdf < 0, instances, 0).astype(np.int32)


def _placed(fitted: FittedSuperquadric) -> PlacedShape:
    return PlacedShape(shape_of(fitted), fitted.pose)


def _parameters(found: Sequence[FittedSuperquadric]) -> SceneParameters:
    def stacked(rows: Sequence[Any]) -> Tensor:
        return torch.from_numpy(np.stack(rows)[None].astype(np.float32))

    return SceneParameters(
        stacked([one.half_axes for one in found]),
        stacked([one.exponents for one in found]),
        stacked([one.pose.rotation for one in found]),
        stacked([one.pose.position for one in found]),
        torch.ones(1, len(found), dtype=torch.bool),
    )
