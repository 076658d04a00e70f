"""Table-top scenes as pure data: models with colours, what lies where, lights, posed triangles.

A texture is a row of `TEXTURE` numbers and is evaluated where a ray meets it, so there are no
image files: kind, period (m), strength (0..1), angle (rad), second colour (3), gloss (0..1).
Colours are linear, in 0..1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenefw.core.types import Float32, Float64, Int32

PLAIN, STRIPES, CHECKER, NOISE, WOOD, SPECKLE, GINGHAM, DOTS, FLORAL, PRINT = range(10)
"""Kinds of texture."""

TEXTURE = 8
"""Numbers that describe a texture."""

PLACEMENT = 13
"""Numbers that say how an item lies."""

COMPARISON = ("surface", "remote_control", "keyboard", "model_plane")
SMALL_OBJECTS = ("surface", "coin", "cable", "pen", "brick", "paperclip", "book")
DESK = (
    "surface", "remote_control", "keyboard", "model_plane", "coin", "cable", "pen", "brick",
    "paperclip", "book", "other",
)  # fmt: skip
"""Classes by id; 0 is the table, `other` everything without a class of its own."""

SPLITS = ("train", "validation", "test")


@dataclass(frozen=True, eq=False)
class TexturedMesh:
    """A model at rest: its footprint about the origin, its lowest point at z = 0, metres.

    Args:
        vertices: (V, 3) float64.
        faces: (F, 3) int64.
        normals: (F, 3, 3) float32 unit normals of the corners of faces.
        colours: (F, 3) float32.
        texture_of: (F,) int32 row of `textures`.
        textures: (M, TEXTURE) float32.
        spine: (S, 3) float64 line along something limp, such as a cable; None = stiff.
        knots: (V,) int64 point of the spine that each vertex follows; None = stiff.
    """

    vertices: Float64
    faces: NDArray[np.int64]
    normals: Float32
    colours: Float32
    texture_of: Int32
    textures: Float32
    spine: Float64 | None = None
    knots: NDArray[np.int64] | None = None


@dataclass(frozen=True)
class TabletopItem:
    """One model on the table.

    Args:
        label: class id.
        instance: of that class.
        x: where (m).
        y: where (m).
        yaw: turn about z (rad), after `rotation`.
        scale: of the model.
        z: height of the model's origin (m).
        rotation: quaternion (w, x, y, z) from the model at rest to the model as it lies.
        lifts: (S,) heights (m) of the points of a limp model's spine over where they would be.
    """

    label: int
    instance: int
    x: float
    y: float
    yaw: float
    scale: float = 1.0
    z: float = 0.0
    rotation: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    lifts: tuple[float, ...] = ()


@dataclass(frozen=True)
class Light:
    """A lamp: position (m), colour and intensity as it arrives at the middle of the table."""

    position: tuple[float, float, float]
    intensity: tuple[float, float, float]


@dataclass(frozen=True)
class TabletopScene:
    """Models on a table; equal scenes look equal.

    Args:
        items: instances of models and how they lie.
        surface: colour of the table (3) and its texture (TEXTURE).
        lights: lamps over the table.
        ambient: light from everywhere (3).
        classes: names by class id.
        index: number of the scene, with the seed its identity.
        seed: seed of the data set.
    """

    items: tuple[TabletopItem, ...]
    surface: tuple[float, ...]
    lights: tuple[Light, ...]
    ambient: tuple[float, float, float]
    classes: tuple[str, ...] = COMPARISON
    index: int = 0
    seed: int = 0


@dataclass(frozen=True, eq=False)
class TabletopGeometry:
    """All triangles of a scene in the world frame, without the table z = 0 itself.

    Args:
        corners: (F, 3, 3) float32 metres.
        normals: (F, 3, 3) float32 unit normals of the corners.
        colours: (F, 3) float32.
        texture_of: (F,) int32 row of `textures`, from 1 on.
        item_of: (F,) int32 position of the item a triangle belongs to.
        labels: (N,) int32 class of each item.
        placements: (N, PLACEMENT) float32 x, y, z, rotation by rows, scale; for textures.
        textures: (M, TEXTURE) float32, row 0 is the table's.
        surface: (3,) float32 colour of the table.
        lights: (L, 6) float32 positions and intensities.
        ambient: (3,) float32.
        classes: names by class id.
        name: of the scene.
    """

    corners: Float32
    normals: Float32
    colours: Float32
    texture_of: Int32
    item_of: Int32
    labels: Int32
    placements: Float32
    textures: Float32
    surface: Float32
    lights: Float32
    ambient: Float32
    classes: tuple[str, ...] = COMPARISON
    name: str = ""

    def arrays(self) -> tuple[NDArray[np.generic], ...]:
        """All that decides what the scene looks like."""
        return (
            self.corners, self.normals, self.colours, self.texture_of, self.item_of, self.labels,
            self.placements, self.textures, self.surface, self.lights, self.ambient,
        )  # fmt: skip
