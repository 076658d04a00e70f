"""Formats that hold a whole scene in one file, for those who choose by suffix."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from scenefw.core.files import write_text
from scenefw.core.types import SceneEstimate, TriangleMesh
from scenefw.core.versions import versions
from scenefw.export.meshes import Colour, write_glb, write_ply
from scenefw.export.summary import write_summary


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
        rows = np.repeat(np.reshape(np.asarray(colours, np.float64), (-1, 3)), counts, axis=0)
        write_ply(path, TriangleMesh(vertices, all_faces), rows)


class OBJ:
    """Wavefront OBJ: `o object_01` ..., with colours after the positions of vertices; z up."""

    suffix = ".obj"

    def write(self, path: Path, estimate: SceneEstimate, colours: Sequence[Colour]) -> None:
        """Writes the file."""
        lines, start = ["# metres, z up"], 1
        for item, colour in zip(estimate.objects, colours, strict=True):
            lines.append(f"o object_{item.id:02d}")
            lines += obj_lines(item.mesh, colour, start)
            start += len(item.mesh.vertices)
        write_text(path, "\n".join(lines) + "\n")


class Summary:
    """`scene.json`: poses, sizes and shapes in numbers."""

    suffix = ".json"

    def write(self, path: Path, estimate: SceneEstimate, colours: Sequence[Colour]) -> None:
        """Writes the file; see `summarise`."""
        write_summary(path, estimate, {}, versions=versions())


def obj_lines(mesh: TriangleMesh, colour: Colour | None = None, start: int = 1) -> list[str]:
    """Lines of OBJ for a mesh, to a tenth of a micrometre.

    Args:
        mesh: triangles.
        colour: red, green, blue in [0, 1] of all its vertices.
        start: number of its first vertex; OBJ counts from 1.
    """
    tail = "" if colour is None else "".join(f" {value:.4f}" for value in colour)
    lines = [f"v {x:.7f} {y:.7f} {z:.7f}{tail}" for x, y, z in mesh.vertices]
    return lines + [f"f {a} {b} {c}" for a, b, c in mesh.faces + start]
