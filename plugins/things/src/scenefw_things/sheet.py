"""A picture of a library of things: a row for each family, several draws of each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from scenefw.core import rng as streams
from scenefw.core.geometry import look_at
from scenefw.core.tabletop import PLACEMENT, TEXTURE, TabletopGeometry, TexturedMesh
from scenefw.core.types import Camera
from scenefw.renderers.mesh_raycaster import MeshRaycaster
from scenefw_things.scenes.painted import paint_count, textured
from scenefw_things.shapes.surface import looks
from scenefw_things.shapes.thing import Thing

TILE = 150
"""Side of a picture of one thing (pixels)."""

_AWAY = 6.0  # radii of a thing from its middle to the camera
_ZOOM = 2.9  # focal length by the picture's side, so that the thing fills it
_LAMP = (0.5, -0.7, 1.2, 0.7, 0.7, 0.7)
_AMBIENT = (0.4, 0.4, 0.4)
_TABLE = (0.6, 0.6, 0.6)


def thing_sheet(rows: Sequence[Sequence[Thing]], seed: int, columns: int = 2) -> Image.Image:
    """Rows of things, in blocks beside each other; what is written is the family and the size."""
    renderer = MeshRaycaster()
    strips = [
        np.concatenate(
            [_tile(thing, renderer, seed, first=k == 0) for k, thing in enumerate(row)], 1
        )
        for row in rows
    ]
    strips += [np.full_like(strips[0], 255)] * (-len(strips) % columns)
    height = len(strips) // columns
    blocks = [np.concatenate(strips[i * height : (i + 1) * height]) for i in range(columns)]
    return Image.fromarray(np.concatenate(blocks, axis=1))


def _tile(thing: Thing, renderer: MeshRaycaster, seed: int, *, first: bool) -> NDArray[np.uint8]:
    rng = streams.generator(seed, streams.number_of(thing.name))
    mesh = textured(thing.parts, looks(rng, paint_count(thing.parts)))
    middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    length = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    azimuth, elevation = rng.uniform(0, 2 * np.pi), rng.uniform(0.35, 0.9)
    ahead = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation),
                      np.sin(elevation)])  # fmt: skip
    pose = look_at(middle + _AWAY * length / 2 * ahead, middle)
    centre = (TILE - 1) / 2
    camera = Camera(TILE, TILE, _ZOOM * TILE, _ZOOM * TILE, centre, centre, pose)
    frame = next(iter(renderer.frames(_alone(mesh), [camera])))
    picture = Image.fromarray(np.asarray(frame.colour))
    words = f"{thing.family}  {100 * length:.0f} cm" if first else f"{100 * length:.0f} cm"
    ImageDraw.Draw(picture).text((3, 2), words, fill=(0, 0, 0))
    return np.asarray(picture)


def _alone(mesh: TexturedMesh) -> TabletopGeometry:
    """A model on an empty table."""
    placement = np.array([[0, 0, 0, *np.eye(3).ravel(), 1]], dtype=np.float32)
    return TabletopGeometry(
        mesh.vertices[mesh.faces].astype(np.float32),
        mesh.normals,
        mesh.colours,
        mesh.texture_of + 1,
        np.zeros(len(mesh.faces), np.int32),
        np.ones(1, np.int32),
        placement.reshape(1, PLACEMENT),
        np.concatenate([np.zeros((1, TEXTURE), np.float32), mesh.textures]),
        np.array(_TABLE, np.float32),
        np.array([_LAMP], np.float32),
        np.array(_AMBIENT, np.float32),
    )
