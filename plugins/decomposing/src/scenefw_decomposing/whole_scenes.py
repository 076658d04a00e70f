"""Whole scenes as they are given, a mesh or posed depth images, to views and to objects."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.core.errors import InputError
from scenefw.data.files.recordings import MeasuredFrames
from scenefw.data.files.sequences import open_sequence
from scenefw_decomposing.scene_meshes import is_mesh, read_scene_mesh

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from scenefw.core.types import Float64, Frame, SceneEstimate, TriangleMesh
    from scenefw.data.files.sequences import RGBDFolder, TUMSequence
    from scenefw.perception.observation.views import Views
    from scenefw.perception.pipeline import ReconstructionPipeline
    from scenefw_decomposing.mesh_views import MeshViews


@dataclass(frozen=True)
class WholeScene:
    """Views of a scene, and the mesh they were made of, if there is one.

    Args:
        name: of the scene.
        frames: with poses in one world.
        T_frames_file: (4, 4) from coordinates of the input, in its own unit and with its own axis
            up, to those of the frames' poses.
        mesh: in coordinates of the frames' poses.
        note: what was done to get the views, in words.
        warnings: what its files left open, a line each.
    """

    name: str
    frames: Sequence[Frame]
    T_frames_file: Float64 = field(default_factory=lambda: np.eye(4))
    mesh: TriangleMesh | None = None
    note: str = ""
    warnings: tuple[str, ...] = ()


def scene_name(path: Path | str) -> str:
    """What a scene in a file or folder is called."""
    full_path = Path(path).resolve()
    return full_path.stem if is_mesh(full_path) else full_path.name


def read_whole_scene(
    path: Path | str,
    meshes: MeshViews,
    mesh_scale: float,
    max_views: int,
    options: Mapping[str, Any] | None = None,
) -> WholeScene:
    """The views of a scene in a file or a folder.

    Args:
        path: a mesh, an RGB-D folder with poses, or a sequence in TUM's format.
        meshes: makes views of meshes.
        mesh_scale: metres per unit of a mesh.
        max_views: of a recording that are read.
        options: of `data.files.sequences.open_sequence`.

    Raises:
        InputError: nothing usable is there.
    """
    path = Path(path)
    if not path.exists():
        raise InputError(
            f"no file or folder {path}; give input=PATH of a mesh, or of a folder of depth images "
            "with poses"
        )
    name = scene_name(path)
    if is_mesh(path):
        mesh, T = read_scene_mesh(path, mesh_scale)  # noqa: N806
        seen_mesh = meshes.see(mesh, name)
        note = f"the table is {seen_mesh.note}"
        return WholeScene(name, seen_mesh.frames, seen_mesh.T_table_mesh @ T, seen_mesh.mesh, note)
    if path.is_file():
        raise InputError(
            f"{path} is no mesh; one depth image is a matter of run=predict, several are given as "
            "a folder with depth/, poses.txt and intrinsics.json"
        )
    recording = open_sequence(path, **dict(options or {}))
    frames, empty = _measured_views(recording, max_views)
    notes = [f"skipped frames without a measurement: {', '.join(map(str, empty))}"] if empty else []
    return WholeScene(name, frames, warnings=(*recording.notes, *notes))


def _measured_views(
    recording: RGBDFolder | TUMSequence, max_views: int
) -> tuple[list[Frame], list[int]]:
    """Views far from each other in which something is measured, and numbers of empty ones."""
    usable, empty = list(range(len(recording.poses))), list[int]()
    while True:
        views = distant_views([recording.poses[number] for number in usable], max_views)
        measured = MeasuredFrames(recording, [usable[view] for view in views])
        frames = list(measured)
        if not measured.empty:
            return frames, empty
        empty = sorted([*empty, *measured.empty])
        usable = [number for number in usable if number not in measured.empty]
        if not usable:
            raise InputError("no frame holds a measurement; give depth images that do")


def distant_views(poses: Sequence[Float64], max_views: int) -> list[int]:
    """Numbers of the images that are used: the first, then always the one farthest off.

    Args:
        poses: camera to world (4, 4) of all images.
        max_views: how many at most.

    Raises:
        InputError: there is none.
    """
    if not poses:
        raise InputError("there is no view; give at least one depth image with its pose")
    places = np.array([pose[:3, 3] for pose in poses])
    selection, nearest = [0], np.linalg.norm(places - places[0], axis=1)
    while len(selection) < min(max_views, len(places)) and nearest.max() > 0:
        selection.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.linalg.norm(places - places[selection[-1]], axis=1))
    return sorted(selection)


def taken_apart(
    scene: WholeScene, views: Views, pipeline: ReconstructionPipeline[Views]
) -> SceneEstimate:
    """The objects of a scene; `details["T_world_input"]` takes the input's coordinates to theirs.

    Args:
        scene: as it was read.
        views: its views, as the pipeline observed them.
        pipeline: finds the objects.

    Raises:
        InputError: the views contradict each other.
    """
    (estimate,) = pipeline.reconstruct(views)
    details = {
        **estimate.details,
        "table": scene.note or estimate.details["table"],
        "T_world_input": views.T_views_input @ scene.T_frames_file,
    }
    return replace(estimate, frame=replace(estimate.frame, name=scene.name), details=details)
