"""A recording for Rerun (.rrd): a prediction with its hypotheses, or a map that grows."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.core.errors import MissingDependencyError
from scenefw.core.files import replacing
from scenefw.export.surface_colours import surface_colours
from scenefw.perception.physics.support_graph import supports_of
from scenefw.report.palette import colours_of
from scenefw_viewer.map_surface import looks, surface

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from scenefw.core.height_maps import HeightMap
    from scenefw.core.types import Frame, SceneEstimate, TriangleMesh

_WORLD = "world"
_OBSTACLE = (150, 150, 150)


def require_rerun() -> Any:
    """The library.

    Raises:
        MissingDependencyError: rerun-sdk is not installed.
    """
    try:
        import rerun
    except ImportError as error:
        raise MissingDependencyError(
            "recordings for Rerun need rerun-sdk: pip install 'scenefw[rerun]'"
        ) from error
    return rerun


@contextlib.contextmanager
def recording(path: Path) -> Iterator[Any]:
    """A stream whose file appears when the block ends, also by an error.

    Args:
        path: `.rrd`.

    Raises:
        MissingDependencyError: rerun-sdk is not installed.
        StorageError: the file can't be written.
    """
    rerun = require_rerun()
    with replacing(path) as temporary:
        stream = rerun.RecordingStream("scenefw", recording_id=path.stem)
        stream.save(str(temporary))
        stream.log(_WORLD, rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        try:
            yield stream
        finally:
            stream.flush()
            stream.disconnect()


def log_prediction(stream: Any, scenes: Sequence[SceneEstimate], frame: Frame) -> None:
    """Logs an image and its hypotheses, which are steps of the timeline `hypothesis`.

    Args:
        stream: as `recording` gives it.
        scenes: hypotheses, the most typical one first; an object has the same id in all.
        frame: the image as it was read, with the pose of its camera in the scene.
    """
    rerun = require_rerun()
    _log_frame(stream, frame, static=True)
    labels = sorted({item.id for scene in scenes for item in scene.objects})
    for number, scene in enumerate(scenes, start=1):
        stream.set_time("hypothesis", sequence=number)
        present = {item.id: item for item in scene.objects}
        paints = dict(zip(present, surface_colours(scene, colours_of(scene)), strict=True))
        for label in labels:
            place = f"{_WORLD}/objects/object_{label:02d}"
            if label in present:
                stream.log(place, _mesh(present[label].mesh, paints[label]))
            else:
                stream.log(place, rerun.Clear(recursive=True))
        for count, obstacle in enumerate(scene.obstacles, start=1):
            paint = np.array(_OBSTACLE) / 255
            stream.log(f"{_WORLD}/obstacles/obstacle_{count:02d}", _mesh(obstacle.mesh, paint))
        if scene.masks is not None:
            masks = scene.masks.astype(np.uint16)
            stream.log(f"{_WORLD}/camera/image/objects", rerun.SegmentationImage(masks))
        stream.log("scene", rerun.TextDocument(_table(scene), media_type="text/markdown"))


class MapRecorder:
    """Logs a map while it grows: what `run=label` takes as a watcher.

    Args:
        stream: as `recording` gives it.
    """

    def __init__(self, stream: Any) -> None:
        self._stream, self._step = stream, 0

    def show(self, height_map: HeightMap, title: str, frame: Frame | None = None) -> None:
        """Logs the map as the next step of the timeline `map`, with the latest image."""
        rerun = require_rerun()
        self._step += 1
        self._stream.set_time("map", sequence=self._step)
        self._stream.log("title", rerun.TextDocument(title))
        if frame is not None:
            _log_frame(self._stream, frame, static=False)
        for look in looks(height_map):
            if not height_map.seen.any():
                continue
            mesh = surface(height_map, look)
            texture = np.asarray(mesh.visual.material.baseColorTexture.convert("RGB"))
            # Rerun's texture coordinates begin at the top, trimesh's at the bottom
            places = np.column_stack([mesh.visual.uv[:, 0], 1 - mesh.visual.uv[:, 1]])
            self._stream.log(
                f"{_WORLD}/map/{look.replace(' ', '_')}",
                rerun.Mesh3D(
                    vertex_positions=np.asarray(mesh.vertices, np.float32),
                    triangle_indices=np.asarray(mesh.faces, np.uint32),
                    vertex_texcoords=places.astype(np.float32),
                    albedo_texture=texture,
                ),
            )


def _log_frame(stream: Any, frame: Frame, *, static: bool) -> None:
    rerun = require_rerun()
    camera = frame.camera
    pose = camera.T_world_camera
    place = f"{_WORLD}/camera"
    stream.log(
        place, rerun.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]), static=static
    )
    pinhole = rerun.Pinhole(
        image_from_camera=camera.matrix, resolution=[camera.width, camera.height]
    )
    stream.log(f"{place}/image", pinhole, static=static)
    if frame.colour is not None:
        stream.log(f"{place}/image/colour", rerun.Image(frame.colour), static=static)
    depth = rerun.DepthImage(frame.depth.astype(np.float32), meter=1.0)
    stream.log(f"{place}/image/depth", depth, static=static)


def _mesh(mesh: TriangleMesh, paint: Any) -> Any:
    rerun = require_rerun()
    corners = mesh.vertices[mesh.faces]
    normals = np.zeros_like(mesh.vertices)
    directions = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    np.add.at(normals, mesh.faces.ravel(), np.repeat(directions, 3, axis=0))
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    colours = np.broadcast_to(np.rint(255 * np.clip(paint, 0, 1)), (len(mesh.vertices), 3))
    return rerun.Mesh3D(
        vertex_positions=mesh.vertices.astype(np.float32),
        triangle_indices=mesh.faces.astype(np.uint32),
        vertex_normals=(normals / np.maximum(lengths, 1e-12)).astype(np.float32),
        vertex_colors=colours.astype(np.uint8),
    )


def _table(scene: SceneEstimate) -> str:
    """Objects of a scene in Markdown, with what they stand on."""
    graph = supports_of(scene)
    lines = ["| object | size (cm) | confidence | stands on |", "| --- | --- | --- | --- |"]
    for item in scene.objects:
        size = " × ".join(f"{100 * side:.0f}" for side in item.extents)
        lines.append(
            f"| {item.id} | {size} | {item.confidence:.0%} | {graph.support_of(item.id)} |"
        )
    return "\n".join([*lines, "", f"take away {' → '.join(map(str, graph.removal_order()))}"])
