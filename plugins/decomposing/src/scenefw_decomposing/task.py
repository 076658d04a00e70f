"""Takes a scene that was seen from several sides, or scanned as a whole, apart into objects."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console

from scenefw.core import geometry
from scenefw.core.errors import ConfigError
from scenefw.core.files import require_apart, require_writable
from scenefw.core.folders import replacing_folder, require_replaceable
from scenefw.core.settings import COUNT, POSITIVE
from scenefw.core.settled import words as settled_words
from scenefw.core.types import TriangleMesh
from scenefw.export.meshes import write_ply
from scenefw.report.overview import write_overview
from scenefw.report.page import write_scene_page
from scenefw.report.scenes3d import Scene3D, layer, packed
from scenefw.report.solids import solids_of
from scenefw.report.window import two_views
from scenefw.tasks.scene_files import write_scene
from scenefw_decomposing.nearest_objects import nearest_objects
from scenefw_decomposing.whole_scenes import read_whole_scene, scene_name, taken_apart

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from scenefw.core.protocols import SceneFormat, Settling
    from scenefw.core.types import SceneEstimate
    from scenefw.perception.observation.views import Views
    from scenefw.perception.pipeline import ReconstructionPipeline
    from scenefw.report.palette import Colour
    from scenefw_decomposing.mesh_views import MeshViews

_REACH = 0.01  # m: vertices farther from all objects belong to none
_LEFT = (0.72, 0.72, 0.72)  # colour of the table


class Decompose:
    """Finds the objects of a whole scene.

    The scene is a folder of depth images with poses (an RGB-D folder or TUM's format), or a mesh,
    which is rendered from all sides. The result is a folder NAME with `scene.json`, `scene.glb`,
    a PLY per object, `overview.png` and `scene.html`; for a mesh also `labelled.ply`, the mesh in
    the colours of its objects. It appears when all of it is written.

    Args:
        input: folder of a recording, or a mesh file.
        pipeline: takes views apart.
        meshes: makes views of meshes.
        output: where the folder goes.
        intrinsics: file of a recording; None = that in the folder.
        depth_scale: metres per unit of integer depth; None = that of the format.
        mesh_scale: metres per unit of a mesh.
        largest_jump: most that the camera moves between two frames (m); None = any.
        poses: convention of the poses, as `pose_conventions.converted` takes it.
        settling: lets the objects come to rest first; None leaves them as they were found.
        exports: what writes further files of the scene, by name.
        overview: also draw `overview.png`.
        page: also write `scene.html`.
        max_views: of a recording that are used.

    Raises:
        ConfigError: no input is given, or a scale is not positive.
    """

    def __init__(
        self,
        input: str | Path | None,  # noqa: A002 - named as the setting on the command line
        pipeline: ReconstructionPipeline[Views],
        meshes: MeshViews,
        output: str | Path = "outputs",
        intrinsics: str | Path | None = None,
        depth_scale: float | None = None,
        mesh_scale: float = 1.0,
        largest_jump: float | None = None,
        poses: str = "opencv",
        settling: Settling | None = None,
        exports: Mapping[str, SceneFormat] | None = None,
        *,
        overview: bool = True,
        page: bool = True,
        max_views: int = 8,
    ) -> None:
        if input is None:
            raise ConfigError(
                "run=decompose needs input=PATH of a mesh, or of a folder of depth images with "
                "poses"
            )
        POSITIVE.require(depth_scale=depth_scale, mesh_scale=mesh_scale)
        POSITIVE.require(largest_jump=largest_jump)
        self.input, self.output = Path(input), Path(output)
        self.folder = self.output / scene_name(input)
        for place in (output, self.folder):
            require_apart(place, input)
        self.pipeline, self.meshes, self.settling = pipeline, meshes, settling
        self.options: dict[str, Any] = {
            "intrinsics": intrinsics,
            "largest_jump": largest_jump,
            "poses": poses,
        }
        if depth_scale is not None:
            self.options["depth_scale"] = depth_scale
        self.mesh_scale, self.exports = mesh_scale, dict(exports or {})
        COUNT.require(max_views=max_views)
        self.overview, self.page, self.max_views = overview, page, max_views

    def run(self) -> dict[str, float]:
        """Takes the scene apart; returns how many objects and views there are, and seconds.

        Raises:
            InputError: the input is unusable.
            StorageError: the folder can't be written.
        """
        start = time.perf_counter()
        require_writable(self.output)
        require_replaceable(self.folder)
        whole_scene = read_whole_scene(
            self.input, self.meshes, self.mesh_scale, self.max_views, self.options
        )
        if whole_scene.note:
            print(f"{whole_scene.name}: {whole_scene.note}")
        for warning in whole_scene.warnings:  # first: it may say why the next step fails
            print(f"{whole_scene.name}: {warning}", file=sys.stderr)
        views = self.pipeline.observe(whole_scene.frames)
        for warning in views.warnings:
            print(f"{whole_scene.name}: {warning}", file=sys.stderr)
        with Console(stderr=True).status(f"{len(whole_scene.frames)} views: parts, then objects"):
            scanned_estimate = taken_apart(whole_scene, views, self.pipeline)
        if whole_scene.mesh is not None and not scanned_estimate.objects:
            width = float(np.ptp(whole_scene.mesh.vertices, axis=0).max())
            line = f"the mesh is {width:.2f} m wide; if it isn't in metres, give run.mesh_scale"
            print(f"{whole_scene.name}: {line}", file=sys.stderr)
        estimate = scanned_estimate
        if self.settling is not None:
            estimate = self.settling.settle([scanned_estimate])[0]
            print(settled_words(estimate))
        with replacing_folder(self.folder) as temporary:
            colours = self._write(temporary, estimate, views, whole_scene.name)
            if whole_scene.mesh is not None:
                vertices = geometry.transform_points(views.T_views_input, whole_scene.mesh.vertices)
                mesh = TriangleMesh(vertices, whole_scene.mesh.faces)
                # what settles leaves the place where it was scanned
                write_ply(
                    temporary / "labelled.ply",
                    mesh,
                    _vertex_colours(mesh, scanned_estimate, colours),
                )
        print(self.folder)
        return {
            "objects": float(len(estimate.objects)),
            "views": float(len(whole_scene.frames)),
            "seconds": time.perf_counter() - start,
        }

    def _write(
        self, folder: Path, estimate: SceneEstimate, views: Views, name: str
    ) -> list[Colour]:
        colours = write_scene(folder, estimate, self.exports)
        if self.page:
            shown = (layer("objects", estimate, colours),)
            scene = Scene3D(name, shown, estimate.frame, estimate.obstacles)
            write_scene_page(folder / "scene.html", name, packed([scene]))
        if self.overview:
            partial = views.observations[0].partial.distance[0, 0].cpu().numpy()
            windows = two_views(solids_of([estimate])[0], estimate)
            write_overview(folder / "overview.png", estimate, partial, colours, windows)
        return colours


def _vertex_colours(
    mesh: TriangleMesh, estimate: SceneEstimate, colours: Sequence[Colour]
) -> np.ndarray:
    """Colour (V, 3) of the object that each vertex is of, grey where it is of none."""
    labels, _ = nearest_objects(mesh.vertices, estimate.objects, _REACH)
    table = {item.id: colour for item, colour in zip(estimate.objects, colours, strict=True)}
    return np.array([table.get(label, _LEFT) for label in labels.tolist()])
