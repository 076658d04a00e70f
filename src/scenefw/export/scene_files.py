"""Formats that hold a whole scene in one file, for those who choose by suffix."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenefw.core.files import write_text
from scenefw.core.types import SceneEstimate, TriangleMesh
from scenefw.core.versions import versions
from scenefw.export.meshes import Colour, write_glb, write_ply
from scenefw.export.summary import write_summary
from scenefw.export.surface_colours import surface_colours


class GLB:
    """glTF binary: a node and a material per object, y up."""

    suffix = ".glb"

    def write(self, path: Path, estimate: SceneEstimate, colours: Sequence[Colour]) -> None:
        """Writes the file; see `write_glb`."""
        write_glb(path, estimate, colours)


class PLY:
    """All objects as one mesh with colours of vertices, metres, z up."""

    suffix = ".ply"

    def write(self, path: Path, estimate: SceneEstimate, colours: Sequence[Colour]) -> None:
        """Writes the file; see `write_ply`."""
        meshes = [item.mesh for item in estimate.objects]
        counts = [len(mesh.vertices) for mesh in meshes]
        starts = np.cumsum([0, *counts])[:-1]
        vertices = np.concatenate([np.zeros((0, 3)), *(mesh.vertices for mesh in meshes)])
        faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]
        all_faces = np.concatenate([np.zeros((0, 3), np.int64), *faces])
        paints = zip(surface_colours(estimate, colours), counts, strict=True)
        painted = [np.broadcast_to(paint, (count, 3)) for paint, count in paints]
        rows = np.concatenate([np.zeros((0, 3)), *painted])
        write_ply(path, TriangleMesh(vertices, all_faces), rows)


class OBJ:
    """Wavefront OBJ: `o object_01` ..., with colours after the positions of vertices; z up."""

    suffix = ".obj"

    def write(self, path: Path, estimate: SceneEstimate, colours: Sequence[Colour]) -> None:
        """Writes the file."""
        lines, start = ["# metres, z up"], 1
        paints = surface_colours(estimate, colours)
        for item, paint in zip(estimate.objects, paints, strict=True):
            lines.append(f"o object_{item.id:02d}")
            lines += obj_lines(item.mesh, paint, start)
            start += len(item.mesh.vertices)
        write_text(path, "\n".join(lines) + "\n")


class Summary:
    """`scene.json`: poses, sizes and shapes in numbers."""

    suffix = ".json"

    def write(self, path: Path, estimate: SceneEstimate, colours: Sequence[Colour]) -> None:
        """Writes the file; see `summarise`."""
        write_summary(path, estimate, {}, versions=versions())


def obj_lines(
    mesh: TriangleMesh, colour: Colour | NDArray[np.float64] | None = None, start: int = 1
) -> list[str]:
    """Lines of OBJ for a mesh, to a tenth of a micrometre.

    Args:
        mesh: triangles.
        colour: red, green, blue in [0, 1] of all its vertices, or (V, 3) of each.
        start: number of its first vertex; OBJ counts from 1.
    """
    lines = [f"v {x:.7f} {y:.7f} {z:.7f}" for x, y, z in mesh.vertices]
    if colour is not None:
        rows = np.broadcast_to(colour, (len(lines), 3))
        tails = [f" {red:.4f} {green:.4f} {blue:.4f}" for red, green, blue in rows]
        lines = [line + tail for line, tail in zip(lines, tails, strict=True)]
    return lines + [f"f {a} {b} {c}" for a, b, c in mesh.faces + start]
