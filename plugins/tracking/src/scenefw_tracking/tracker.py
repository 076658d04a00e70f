"""Follows objects over the images of a scene; only what has changed is reconstructed anew."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.errors import InputError
from scenefw.core.geometry import inverse
from scenefw.perception.estimate.marked_objects import called
from scenefw.perception.estimate.transforms import (
    moved,
    moved_field,
    moved_obstacle,
    without,
)
from scenefw.perception.observation.image_turns import turned_camera, turned_pixels
from scenefw.perception.observation.points import world_points
from scenefw.perception.observation.surface_mesh import obstacles_of
from scenefw_tracking.changes import CHANGED, Change, is_seen_through
from scenefw_tracking.depth_memory import DepthMemory, depth_sigma
from scenefw_tracking.rigid_motion import matched
from scenefw_tracking.tracked_scene import TrackedScene, merged, with_tracks
from scenefw_tracking.tracks import Appearance, Track, masks_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from collections.abc import Set as AbstractSet

    from numpy.typing import NDArray

    from scenefw.core.types import Float64, Frame, Int32, ObjectEstimate, SceneEstimate
    from scenefw.perception.observation.observation import Observation
    from scenefw.perception.observation.workspace import Workspace
    from scenefw.perception.pipeline import ReconstructionPipeline

    Mask = NDArray[np.bool_]
    Tracks = Mapping[int, Track]

_MOVED = (
    "most has changed and everything is reconstructed anew; if the camera has moved, give "
    "camera_pose with each image, as without it the camera must stand still"
)


class Tracker:
    """Follows objects over the images of a scene.

    Depth is compared with what it was, in units of the sensor's noise, which the floor shows. Of
    the image of a still camera, only what has changed is reconstructed anew. An object in there is
    one that was there before if both overlap after a rigid motion.

    Args:
        pipeline: makes the scene of one image.
        hypotheses: without them, only the most typical scene is made.
    """

    def __init__(
        self, pipeline: ReconstructionPipeline[Observation], *, hypotheses: bool = True
    ) -> None:
        self.pipeline, self.hypotheses = pipeline, hypotheses
        self._scene: TrackedScene | None = None

    def track(
        self,
        frame: Frame,
        mask: Mask | Int32 | None = None,
        T_base_camera: Float64 | None = None,  # noqa: N803
    ) -> TrackedScene:
        """The scene after the next image; one that is refused changes nothing.

        Args:
            frame: of the same camera as those before.
            mask: (H, W) bool, where objects are; None: anywhere.
            T_base_camera: 4x4 pose of the camera in a base that stands still; None: it stands.

        Raises:
            InputError: the image is unusable, of another size or camera, or masks have ids.
        """
        if mask is not None and mask.dtype != np.bool_:
            raise InputError(
                "masks with ids say already which object is which; give masks of two values, or "
                "leave tracking out"
            )
        region = None if mask is None else mask.astype(bool)
        if self._scene is None:
            self._scene = replace(self._first(frame, region), T_base_camera=T_base_camera)
        else:
            self._scene = self._next(frame, region, self._scene, T_base_camera)
        return self._scene

    def _first(self, frame: Frame, mask: Mask | None) -> TrackedScene:
        view = self.pipeline.observe(frame, mask)
        scenes = self._reconstruct(view)
        memory = DepthMemory.of(frame.depth, depth_sigma(view))
        tracks = {
            label: Track.new(item, Appearance.of(_mask(label, scenes), memory), frame.name)
            for label, item in _items(scenes).items()
        }
        return TrackedScene(
            with_tracks(scenes, tracks),
            tracks,
            frame.depth,
            memory,
            view.partial.distance[0, 0].cpu().numpy(),
            _left_out(view),
            warnings=view.warnings,
        )

    def _next(
        self,
        frame: Frame,
        mask: Mask | None,
        before: TrackedScene,
        T_base_camera: Float64 | None,  # noqa: N803
    ) -> TrackedScene:
        before.require_camera_of(frame)
        pose = before.camera_pose(T_base_camera)
        if not before.is_seen_from(pose):
            scene = self._all(frame, mask, before, pose)
            return replace(scene, T_base_camera=T_base_camera)
        change = Change.of(frame.depth, before.memory, before.tracks.values())
        if change.is_none:
            return before.unchanged(frame)
        pose = before.frame.camera.T_world_camera
        if change.is_total:
            scene = self._all(frame, mask, before, pose)
            return replace(scene, warnings=(*scene.warnings, _MOVED))
        if self.pipeline.segmentation is None:  # volumes alone can't leave pixels out
            return self._all(frame, mask, before, pose)
        return self._part(frame, mask, before, change)

    def _all(
        self, frame: Frame, mask: Mask | None, before: TrackedScene, pose: Float64
    ) -> TrackedScene:
        """The scene with all that the image shows made anew."""
        view = self.pipeline.observe(frame, mask)
        memory = DepthMemory.of(frame.depth, depth_sigma(view))
        motion = pose @ inverse(_camera_pose(view))
        scenes = [_brought(scene, motion) for scene in self._reconstruct(view)]
        past = {label: replace(t, appearance=None) for label, t in before.tracks.items()}
        scenes, tracks = _identified(scenes, past, set(past), memory, frame)
        posed = replace(frame, camera=frame.camera.moved(pose))
        for label in before.tracks.keys() - tracks.keys():
            track = past[label]
            is_gone = not track.is_present or is_seen_through(track.item.mesh, posed, memory)
            tracks[label] = (track.gone if is_gone else track.hidden)(frame.name)
        scene = replace(before, depth=frame.depth, memory=memory, tracks=tracks)
        return _merged(scene, scenes, view, motion, frame, pose)

    def _part(
        self, frame: Frame, mask: Mask | None, before: TrackedScene, change: Change
    ) -> TrackedScene:
        """The scene with only the changed part of the image made anew."""
        view = self.pipeline.observe(frame, mask)
        pose = before.frame.camera.T_world_camera
        motion = pose @ inverse(_camera_pose(view))
        replaced_ids, regions = change.regions(
            _object_pixels(view),
            before.tracks.values(),
            world_points(replace(frame, camera=frame.camera.moved(pose))),
        )
        is_same = before.memory.matches(frame.depth) | (frame.depth == 0)
        depth = np.where(is_same, before.depth, frame.depth)
        memory = DepthMemory.of(depth, depth_sigma(view))
        still = [t for t in before.tracks.values() if t.is_present and t.id not in replaced_ids]
        scenes: list[SceneEstimate] = []
        if (regions == CHANGED).any():
            scenes = self._reconstruct(view, turned_pixels(regions, view.turns))
            scenes = [_brought(_changed_part(scene, regions), motion) for scene in scenes]
        scenes, tracks = _identified(scenes, before.tracks, replaced_ids, memory, frame)
        tracks |= {track.id: track.at_rest(frame.depth, frame.name) for track in still}
        for label in before.tracks.keys() - tracks.keys():
            tracks[label] = before.tracks[label].gone(frame.name)
        scene = replace(before, depth=depth, memory=memory, tracks=tracks)
        return _merged(scene, scenes, view, motion, frame, pose)

    def _reconstruct(self, view: Observation, regions: Int32 | None = None) -> list[SceneEstimate]:
        return self.pipeline.reconstruct(view, first_only=not self.hypotheses, regions=regions)


def _identified(
    scenes: Sequence[SceneEstimate],
    tracks: Tracks,
    ids: AbstractSet[int],
    memory: DepthMemory,
    frame: Frame,
) -> tuple[list[SceneEstimate], dict[int, Track]]:
    """Hypotheses of what is new in an image, with the ids that its objects have had, and tracks.

    Args:
        scenes: hypotheses, in the world frame of the tracks.
        tracks: of all objects before the image.
        ids: of those that may have moved; those that are gone may have come back.
        memory: of the image.
        frame: the image.
    """
    missing = {i: t.item for i, t in tracks.items() if i in ids or not t.is_present}
    items = _items(scenes)
    pairs = matched(missing, items)
    unused = itertools.count(max(tracks, default=0) + 1)
    new_ids = {label: pairs[label][0] if label in pairs else next(unused) for label in items}
    table = [new_ids.get(label, 0) for label in range(1, max(items, default=0) + 1)]
    scenes = [called(scene, table) for scene in scenes]
    updates = {}
    for label, item in _items(scenes).items():
        appearance = Appearance.of(_mask(label, scenes), memory)
        updates[label] = Track.new(item, appearance, frame.name)
    for label, motion in pairs.values():
        updates[label] = tracks[label].continued(updates[label], motion, frame.depth, frame.name)
    return scenes, updates


def _items(scenes: Sequence[SceneEstimate]) -> dict[int, ObjectEstimate]:
    """Objects by id, each as in the first hypothesis that has it."""
    return {item.id: item for scene in reversed(scenes) for item in reversed(scene.objects)}


def _mask(label: int, scenes: Sequence[SceneEstimate]) -> Mask:
    """Pixels (H, W) of an object in the first hypothesis that has it."""
    scene = next(scene for scene in scenes if label in [item.id for item in scene.objects])
    if scene.masks is None:
        raise InputError("this method doesn't say which pixels show its objects; it can't track")
    return np.asarray(scene.masks == label)


def _changed_part(scene: SceneEstimate, regions: Int32) -> SceneEstimate:
    """A scene without objects most of whose pixels are in regions that haven't changed."""
    assert scene.masks is not None
    count = max([item.id for item in scene.objects], default=0) + 1
    everywhere = np.bincount(scene.masks[regions > 0], minlength=count)
    changed = np.bincount(scene.masks[regions == CHANGED], minlength=count)
    return without(scene, [i.id for i in scene.objects if 2 * changed[i.id] < everywhere[i.id]])


def _brought(scene: SceneEstimate, motion: Float64) -> SceneEstimate:
    """A scene in other coordinates, 4x4 from its own."""
    return moved(scene, {item.id: motion for item in scene.objects})


def _merged(
    scene: TrackedScene,
    scenes: Sequence[SceneEstimate],
    view: Observation,
    motion: Float64,
    frame: Frame,
    pose: Float64,
) -> TrackedScene:
    """The tracked scene with what is new in an image.

    Args:
        scene: with its tracks after the image, and its hypotheses before it.
        scenes: hypotheses of what is new.
        view: of the image.
        motion: 4x4, from its frame to the world.
        frame: the image.
        pose: 4x4, of its camera in the world.
    """
    partial = moved_field(view.partial.distance[0, 0].cpu().numpy(), view.grid, motion)
    scene = replace(scene, partial=partial, left_out=_left_out(view), warnings=view.warnings)
    obstacles = tuple(moved_obstacle(item, motion) for item in obstacles_of([view]))
    masks = masks_of(scene.tracks.values(), frame.depth)
    posed = scene.posed(frame, pose)
    hypotheses = merged(scene.scenes, scenes, scene.tracks, masks, obstacles, posed)
    details = {"warnings": list(view.warnings)}
    hypotheses = [replace(h, details={**h.details, **details}) for h in hypotheses]
    return replace(scene, scenes=with_tracks(hypotheses, scene.tracks))


def _camera_pose(view: Observation) -> Float64:
    """4x4, camera of the image as it was read to the frame of an observation."""
    return turned_camera(_workspace(view).frame.camera, -view.turns).T_world_camera


def _object_pixels(view: Observation) -> Mask:
    """(H, W) of the image as it was read."""
    return turned_pixels(_workspace(view).objects, -view.turns)


def _left_out(view: Observation) -> Mask:
    """(H, W) pixels of the image as it was read whose depth the observation leaves out."""
    assert view.source is not None
    depth = turned_pixels(_workspace(view).frame.depth, -view.turns)
    return np.asarray((depth == 0) & (view.source.depth > 0))


def _workspace(view: Observation) -> Workspace:
    assert view.workspace is not None  # of an observer, unlike those of volumes
    return view.workspace
