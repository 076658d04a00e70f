"""A scene after an image, and how the next one changes it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.errors import InputError
from scenefw.core.geometry import inverse
from scenefw.perception.estimate.base_frame import TRACKS
from scenefw.perception.estimate.transforms import joined, without
from scenefw_tracking.changes import stands_still
from scenefw_tracking.tracks import State

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from scenefw.core.types import Float32, Float64, Frame, Int32, Obstacle, SceneEstimate
    from scenefw_tracking.depth_memory import DepthMemory
    from scenefw_tracking.tracks import Track

    Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class TrackedScene:
    """A scene after an image.

    Args:
        scenes: its hypotheses, all in the world frame of the first image; an object has the same id
            in all images, and the detail `tracks` says what each does.
        tracks: by id, also of objects that are gone.
        depth: (H, W) that pixels have shown when they changed last (m).
        memory: of that.
        partial: (X, Y, Z) partial TSDF of the last image that was looked at anew (m).
        left_out: (H, W) pixels of obstacles, and what else observations leave out.
        T_base_camera: 4x4, where the camera moved last; None: nobody said it.
        warnings: what looks wrong about the last image, if it was looked at anew.
    """

    scenes: tuple[SceneEstimate, ...]
    tracks: Mapping[int, Track]
    depth: Float32
    memory: DepthMemory
    partial: Float32
    left_out: Mask
    T_base_camera: Float64 | None = None
    warnings: tuple[str, ...] = ()

    @property
    def frame(self) -> Frame:
        """The last image, with the pose of its camera."""
        return self.scenes[0].frame

    def camera_pose(self, T_base_camera: Float64 | None) -> Float64:  # noqa: N803
        """4x4, camera of a further image to the world.

        Args:
            T_base_camera: its pose in the base; None: the camera stands still.

        Raises:
            InputError: it is missing, or that of the images before is.
        """
        before = self.frame.camera.T_world_camera
        if T_base_camera is None and self.T_base_camera is None:
            return before
        if T_base_camera is None or self.T_base_camera is None:
            raise InputError(
                "camera_pose is given for some of the images; give it with each, or with none if "
                "the camera stands still"
            )
        pose: Float64 = before @ inverse(self.T_base_camera) @ T_base_camera
        return pose

    def is_seen_from(self, T_world_camera: Float64) -> bool:  # noqa: N803
        """Whether a camera of this pose (4x4) sees it as the one before has."""
        return stands_still(replace(self.frame, depth=self.depth), self.memory, T_world_camera)

    def require_camera_of(self, frame: Frame) -> None:
        """Checks a further image.

        Raises:
            InputError: it has another size, or other intrinsics.
        """
        camera, first = frame.camera, self.frame.camera
        sizes = [f"{c.width} x {c.height}" for c in (camera, first)]
        if sizes[0] != sizes[1]:
            raise InputError(
                f"{frame.name} is {sizes[0]}, but the images before are {sizes[1]}; track images "
                "of one camera"
            )
        if not np.allclose(camera.matrix, first.matrix):
            raise InputError(
                f"{frame.name} has other intrinsics than the images before; track images of one "
                "camera"
            )

    def unchanged(self, frame: Frame) -> TrackedScene:
        """The same after an image that shows nothing new."""
        tracks = {
            label: track.at_rest(frame.depth, frame.name) if track.is_present else track
            for label, track in self.tracks.items()
        }
        posed = self.posed(frame, self.frame.camera.T_world_camera)
        scenes = [replace(scene, frame=posed) for scene in self.scenes]
        return replace(self, scenes=with_tracks(scenes, tracks), tracks=tracks, warnings=())

    def posed(self, frame: Frame, T_world_camera: Float64) -> Frame:  # noqa: N803
        """A further image, as the estimates hold it."""
        depth = np.where(self.left_out, np.float32(0), frame.depth)
        return replace(frame, depth=depth, camera=frame.camera.moved(T_world_camera))


def merged(
    before: Sequence[SceneEstimate],
    after: Sequence[SceneEstimate],
    tracks: Mapping[int, Track],
    masks: Int32,
    obstacles: tuple[Obstacle, ...],
    frame: Frame,
) -> list[SceneEstimate]:
    """Hypotheses with objects of those before that stay, and those that are new.

    Args:
        before: hypotheses before an image.
        after: of its changed part, with the ids of the tracks, in the same frame; none: it is bare.
        tracks: after the image.
        masks: (H, W) of the image.
        obstacles: of the image.
        frame: the image, with its pose.
    """
    new_ids = {item.id for scene in after for item in scene.objects}
    merged_scenes = []
    for number in range(max(len(before), len(after))):
        old = before[min(number, len(before) - 1)]
        dropped = [
            item.id
            for item in old.objects
            if item.id in new_ids or tracks[item.id].state == State.GONE
        ]
        scene = without(old, dropped) if dropped else old
        if after:
            scene = joined(scene, after[min(number, len(after) - 1)])
        merged_scenes.append(replace(scene, masks=masks, frame=frame, obstacles=obstacles))
    return merged_scenes


def with_tracks(
    scenes: Sequence[SceneEstimate], tracks: Mapping[int, Track]
) -> tuple[SceneEstimate, ...]:
    """The scenes, whose details say what each object does."""
    facts = [track.facts() for _, track in sorted(tracks.items())]
    return tuple(replace(s, details={**s.details, TRACKS: facts}) for s in scenes)
