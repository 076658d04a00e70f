"""Models of things as renderers take them: triangles with normals and looks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scenefw.core.tabletop import TEXTURE, TexturedMesh
from scenefw.kernels.corner_normals import corner_normals
from scenefw_tabletops.shapes.tabletop.parts import Look
from scenefw_things.shapes.solids import Part
from scenefw_things.shapes.surface import surface

_SMOOTH = 0.8  # cosine of normals from which sides meet in an edge; polygons of 24 sides have 0.97


def textured(parts: Sequence[Part], looks: Sequence[Look]) -> TexturedMesh:
    """Convex parts as one model, with a look for each paint."""
    sides = surface(parts)
    colours = np.array([look.colour for look in looks], dtype=np.float32)
    textures = np.array([look.texture() for look in looks], dtype=np.float32)
    return TexturedMesh(
        sides.vertices,
        sides.faces,
        corner_normals(sides.vertices, sides.faces, _SMOOTH).astype(np.float32),
        colours[sides.paints],
        sides.paints.astype(np.int32),
        textures.reshape(-1, TEXTURE),
    )


def paint_count(parts: Sequence[Part]) -> int:
    """Number of looks that parts need."""
    return 1 + max(part.paint for part in parts)
