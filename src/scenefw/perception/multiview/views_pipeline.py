"""From several depth images of one scene to complete objects."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import torch

from scenefw.core import rng
from scenefw.core.batches import Completion
from scenefw.core.errors import InputError
from scenefw.core.settings import COUNT
from scenefw.data.files.sequences import transformed
from scenefw.kernels.cameras import stack_cameras
from scenefw.mapping.several_views import fused
from scenefw.perception.estimate.assembly import cleaned, scene_estimate
from scenefw.perception.evidence.nearest_objects import explained_shares
from scenefw.perception.observation.doctor import Doctor
from scenefw.perception.observation.points import world_points
from scenefw.perception.observation.table_frame import TableFrame
from scenefw.perception.observation.workspace import Workspace, WorkspaceFinder

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.batches import PartialTSDF
    from scenefw.core.protocols import MappingMethod, SeveralViewsReconstructor
    from scenefw.core.types import Float64, Frame, GridSpec, SceneEstimate

_MAX_DISTANCE, _REACH = 0.006, 0.02  # m: to a surface that explains a point, and to one that may
_MAX_POINTS = 20000  # of all views, to say how well objects explain them


@dataclass(frozen=True)
class SeenScene:
    """Depth images of one scene, made ready.

    Args:
        workspaces: the frames in the world frame of the objects, and which pixels show these.
        partials: batches of one, a view each.
        moved: (4, 4) from coordinates of the frames as they were given to these.
        warnings: what looks wrong, one line each.
        table: where it is, in words.
    """

    workspaces: tuple[Workspace, ...]
    partials: tuple[PartialTSDF, ...]
    moved: Float64
    warnings: tuple[str, ...]
    table: str


class ViewsPipeline:
    """Completes the objects of a scene that several depth images show.

    Args:
        reconstructor: from several partial TSDFs to complete objects.
        mapping: from depth to partial TSDF.
        grid: the cube around the objects.
        table: finds the table, if the poses are of another world.
        workspace: finds the objects on it.
        doctor: checks the images.
        views: images of a recording that `chosen` takes at most.
        seed: of methods that draw.

    Raises:
        ConfigError: no view.
    """

    def __init__(
        self,
        reconstructor: SeveralViewsReconstructor,
        mapping: MappingMethod,
        grid: GridSpec,
        table: TableFrame | None = None,
        workspace: WorkspaceFinder | None = None,
        doctor: Doctor | None = None,
        views: int = 8,
        seed: int = 0,
    ) -> None:
        COUNT.require(views=views)
        self.reconstructor, self.mapping, self.grid = reconstructor, mapping, grid
        self.table = table or TableFrame()
        self.workspace = workspace or WorkspaceFinder()
        self.doctor = doctor or Doctor()
        self.views, self.seed = views, seed

    def estimate(self, frames: Sequence[Frame]) -> SceneEstimate:
        """The complete scene of frames whose poses are in one world.

        Raises:
            InputError: there is no frame, or one is unusable; or they are of several scenes.
        """
        return self.complete(self.prepare(frames))

    def chosen(self, poses: Sequence[Float64]) -> list[int]:
        """Numbers of the images that are used: the first, then always the one farthest off.

        Args:
            poses: camera to world (4, 4) of all images.

        Raises:
            InputError: there is none.
        """
        if not poses:
            raise _no_view()
        places = np.array([pose[:3, 3] for pose in poses])
        selection, nearest = [0], np.linalg.norm(places - places[0], axis=1)
        while len(selection) < min(self.views, len(places)) and nearest.max() > 0:
            selection.append(int(nearest.argmax()))
            nearest = np.minimum(nearest, np.linalg.norm(places - places[selection[-1]], axis=1))
        return sorted(selection)

    def prepare(self, frames: Sequence[Frame]) -> SeenScene:
        """Checks, table, workspace and partial TSDFs of frames whose poses are in one world.

        Raises:
            InputError: as `estimate`.
        """
        if not frames:
            raise _no_view()
        warnings = [line for frame in frames for line in self.doctor.examine_frame(frame)]
        alignment = self.table.alignment(frames[0], posed=True)
        if not alignment.table:
            warnings.append(alignment.note)
        posed_frames = list(transformed(frames, alignment.T_table_world))
        workspaces = self.workspace.find_together(posed_frames, self.grid)
        warnings += self.doctor.examine_workspaces(workspaces)
        partials = tuple(self._partial(workspace.frame) for workspace in workspaces)
        input_camera, output_camera = frames[0].camera, workspaces[0].frame.camera
        transform = output_camera.T_world_camera @ np.linalg.inv(input_camera.T_world_camera)
        table = "found in the first image" if alignment.note else "the plane z = 0 of the poses"
        distinct_warnings = tuple(dict.fromkeys(warnings))
        return SeenScene(tuple(workspaces), partials, transform, distinct_warnings, table)

    def complete(self, scene: SeenScene) -> SceneEstimate:
        """The complete scene.

        Raises:
            InputError: the views contradict each other.
        """
        generator = torch.Generator().manual_seed(rng.torch_seed(self.seed))
        if any(workspace.objects.any() for workspace in scene.workspaces):
            completion = self.reconstructor.complete(scene.partials, self.grid, 1, generator)[0]
        else:
            completion = _empty_scene(self.grid)
        cleaned_completion = cleaned(completion, self.grid, fused(scene.partials, self.grid))
        details = {
            "confidence": f"share of seen points within {_MAX_DISTANCE * 1000:g} mm of the surface",
            "views": [workspace.frame.name for workspace in scene.workspaces],
            "table": scene.table,
            "seed": self.seed,
            "warnings": list(scene.warnings),
        }
        frame = scene.workspaces[0].frame
        estimate = scene_estimate(cleaned_completion, self.grid, frame, {}, details)
        shares = explained_shares(_seen_points(scene), estimate.objects, _MAX_DISTANCE, _REACH)
        objects = tuple(replace(item, confidence=shares[item.id]) for item in estimate.objects)
        return replace(estimate, objects=objects)

    def _partial(self, frame: Frame) -> PartialTSDF:
        depth = torch.from_numpy(frame.depth)[None]
        return self.mapping.fuse(depth, self.grid, stack_cameras([frame.camera]))


def _empty_scene(grid: GridSpec) -> Completion:
    """The complete scene of a table on which nothing stands."""
    free = torch.full((1, *grid.shape), grid.truncation)
    return Completion(free, torch.zeros(1, *grid.shape, dtype=torch.int32))


def _no_view() -> InputError:
    return InputError("there is no view; give at least one depth image with its pose")


def _seen_points(scene: SeenScene) -> Float64:
    """Some of the points (N, 3) of objects in all views (m)."""
    points = np.concatenate(
        [world_points(workspace.frame)[workspace.objects] for workspace in scene.workspaces]
    )
    return points[:: max(1, len(points) // _MAX_POINTS)]
