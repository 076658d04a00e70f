"""Scenes to turn in a page: meshes, points and names, packed so that a browser can unpack them."""

from __future__ import annotations

import base64
import gzip
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.core.types import TriangleMesh
from scenefw.perception.observation.points import world_points
from scenefw.perception.physics.support_graph import supports_of
from scenefw.report.blocks import Scenes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Frame, Obstacle, SceneEstimate
    from scenefw.report.palette import Colour

_UNIT = 1e-4  # m: positions are whole numbers of it
_FARTHEST = 32767 * _UNIT
_GREY = (110, 120, 130)
_LEVEL = 6  # of compression; 9 takes three times as long for 1 % less


@dataclass(frozen=True)
class Solid:
    """One object: its name and colour (red, green, blue in [0, 1]), and its surface (m)."""

    name: str
    colour: Colour
    mesh: TriangleMesh


@dataclass(frozen=True)
class Layer:
    """Objects shown together: a prediction, another hypothesis, the truth.

    Args:
        name: what they are.
        solids: the objects; their names begin with their ids and a colon.
        supports: `SupportGraph.facts` of them; None: nobody has asked.
    """

    name: str
    solids: tuple[Solid, ...]
    supports: Mapping[str, Any] | None = None


@dataclass(frozen=True)
class Scene3D:
    """What one image shows, world frame (m, z up, floor z = 0).

    Args:
        name: of the image.
        layers: one of them is shown at a time, the first one first.
        frame: its points are drawn too, and the scene is first seen from its side.
        obstacles: walls, robots, containers, in all layers.
    """

    name: str
    layers: tuple[Layer, ...]
    frame: Frame
    obstacles: tuple[Obstacle, ...] = ()


def layer(
    name: str,
    estimate: SceneEstimate,
    colours: Sequence[Colour],
    *,
    confidence: bool = True,
    supports: bool = True,
) -> Layer:
    """The objects of an estimate; their names say id and size.

    Args:
        name: of the layer.
        estimate: the scene.
        colours: of its objects, in their order.
        confidence: it is known; names say it too.
        supports: also what stands on what.
    """
    solids = []
    for item, colour in zip(estimate.objects, colours, strict=True):
        size = " × ".join(f"{100 * side:.0f}" for side in item.extents)
        text = f"{item.id}: {size} cm" + (f", {item.confidence:.0%}" if confidence else "")
        solids.append(Solid(text, colour, item.mesh))
    graph = supports_of(estimate).facts() if supports else None
    return Layer(name, tuple(solids), graph)


def packed(scenes: Sequence[Scene3D], caption: str = "", max_points: int = 20000) -> Scenes:
    """The block of a page that shows scenes, one at a time.

    Positions are rounded to a tenth of a millimetre; points farther than 3.2 m from the origin are
    left out.

    Args:
        scenes: in the order of the choice.
        caption: one line.
        max_points: of each scene's image.
    """
    buffer = _Buffer()
    header = {
        "unit": _UNIT,
        "scenes": [
            {
                "name": scene.name,
                "eye": scene.frame.camera.T_world_camera[:3, 3].tolist(),
                "layers": [_layer(scene_layer, buffer) for scene_layer in scene.layers],
                "points": _points(scene.frame, buffer, max_points),
                "obstacles": [_obstacle(item, buffer) for item in scene.obstacles],
            }
            for scene in scenes
        ],
    }
    data = base64.b64encode(gzip.compress(buffer.content(), _LEVEL, mtime=0)).decode("ascii")
    return Scenes(header, data, caption)


class _Buffer:
    """Arrays one after the other, each from a multiple of four bytes on."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0

    def add(self, array: NDArray[Any]) -> list[int]:
        """Appends an array; returns where it begins and how many numbers it has."""
        content, start = array.tobytes(), self._size
        content += b"\0" * (-len(content) % 4)
        self._parts.append(content)
        self._size += len(content)
        return [start, array.size]

    def content(self) -> bytes:
        return b"".join(self._parts)


def _layer(layer: Layer, buffer: _Buffer) -> dict[str, Any]:
    solids = [_solid(solid, buffer) for solid in layer.solids]
    return {"name": layer.name, "solids": solids, "supports": layer.supports}


def _obstacle(obstacle: Obstacle, buffer: _Buffer) -> dict[str, Any]:
    """Without triangles that reach too far to be packed."""
    mesh = obstacle.mesh
    is_near = np.abs(mesh.vertices).max(axis=1, initial=0) < _FARTHEST
    faces = mesh.faces[is_near[mesh.faces].all(axis=1)]
    red, green, blue = (value / 255 for value in _GREY)
    return _solid(
        Solid(obstacle.kind, (red, green, blue), TriangleMesh(mesh.vertices, faces)), buffer
    )


def _solid(solid: Solid, buffer: _Buffer) -> dict[str, Any]:
    mesh = solid.mesh
    # Differences of neighbours are small numbers, which compress to half
    vertices = np.diff(_quantise(mesh.vertices), axis=0, prepend=np.int16(0))
    faces = np.diff(mesh.faces.astype("<i4").reshape(-1), prepend=np.int32(0))
    return {
        "name": solid.name,
        "colour": [round(float(value), 3) for value in solid.colour],
        "vertices": buffer.add(vertices.astype("<i2")),
        "faces": buffer.add(faces.astype("<i4")),
    }


def _points(frame: Frame, buffer: _Buffer, max_points: int) -> dict[str, Any]:
    stride = max(1, int(np.ceil(np.sqrt(np.count_nonzero(frame.depth) / max_points))))
    points = world_points(frame, stride)
    keep_mask = np.asarray(np.isfinite(points).all(axis=-1))
    keep_mask[keep_mask] = np.abs(points[keep_mask]).max(axis=-1, initial=0) < _FARTHEST
    if frame.colour is None:
        colours = np.broadcast_to(np.array(_GREY, dtype=np.uint8), (int(keep_mask.sum()), 3))
    else:
        colours = frame.colour[::stride, ::stride][keep_mask]
    return {
        "positions": buffer.add(_quantise(points[keep_mask])),
        "colours": buffer.add(np.ascontiguousarray(colours)),
    }


def _quantise(points: NDArray[np.float64]) -> NDArray[np.int16]:
    limit = np.iinfo(np.int16).max
    return np.clip(np.rint(points / _UNIT), -limit, limit).astype("<i2")
