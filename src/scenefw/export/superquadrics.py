"""The superquadrics of a scene as JSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from scenefw.core.files import write_text
from scenefw.export.summary import shape_numbers
from scenefw.shapes.superellipsoid import Superellipsoid
from scenefw.shapes.superquadric import Superquadric

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.types import PlacedShape, SceneEstimate
    from scenefw.export.meshes import Colour


class Superquadrics:
    """|x/a1|^r + |y/a2|^s + |z/a3|^t = 1 of each object that one explains.

    `superquadrics` is a list of `id`, `kind`, `half_axes`, `exponents` (r, s, t), `position` and
    `quaternion` (w, x, y, z) in the world frame, metres; `unexplained` has the ids of others.
    """

    suffix = ".superquadrics.json"

    def write(self, path: Path, estimate: SceneEstimate, colours: Sequence[Colour]) -> None:
        """Writes the file, atomically."""
        entries = [
            {"id": int(item.id), **shape_numbers(item.placed)}
            for item in estimate.objects
            if item.placed is not None and _convex(item.placed)
        ]
        unexplained_ids = [
            int(item.id)
            for item in estimate.objects
            if item.placed is None or not _convex(item.placed)
        ]
        content = {"superquadrics": entries, "unexplained": unexplained_ids}
        write_text(path, json.dumps(content, indent=2, allow_nan=False) + "\n")


def _convex(placed: PlacedShape) -> bool:
    return isinstance(placed.shape, Superquadric | Superellipsoid)
