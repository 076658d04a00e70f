"""Families of meshes, each of which belongs to one part of the data."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from scenefw.core.errors import ConfigError, InputError
from scenefw_single_view_benchmarks.mesh_solids import MeshSolids

if TYPE_CHECKING:
    import numpy as np

    from scenefw.shapes.convex_parts import ConvexParts
    from scenefw.shapes.solid_mesh import SolidMesh


class MeshFamilies:
    """Solids from folders of meshes, whose families are dealt out to the parts of the data.

    Args:
        root: folder that holds a folder of meshes (m) for each family.
        families: names of these folders by part of the data.
        leave_out: pattern of paths below the root, without suffix, to leave out; or None.
        longest: meshes with a longer side are left out (m).
        shortest: meshes whose longest side is shorter are left out (m).
        parts: divides meshes into convex parts; None: they collide as their convex hulls.

    Raises:
        ConfigError: no root is given, or a family belongs to two parts.
    """

    def __init__(
        self,
        root: str | None,
        families: Mapping[str, Sequence[str]],
        leave_out: str | None = None,
        longest: float = 0.3,
        shortest: float = 0.03,
        parts: ConvexParts | None = None,
    ) -> None:
        if root is None:
            raise ConfigError(
                "scenes of household things need meshes; give input=FOLDER that holds the "
                f"families {', '.join(sorted({f for names in families.values() for f in names}))}"
            )
        names = [name for part in families.values() for name in part]
        shared = sorted({name for name in names if names.count(name) > 1})
        if shared:
            raise ConfigError(
                f"families {', '.join(shared)} belong to two parts of the data; give each to one"
            )
        self.root, self.leave_out, self.parts = str(Path(root).resolve()), leave_out, parts
        self.families = {part: tuple(members) for part, members in families.items()}
        self.longest, self.shortest = longest, shortest
        self.files = _files(Path(self.root), self.families)
        self._solids: dict[str, MeshSolids] = {}

    def sample(self, rng: np.random.Generator, split: str) -> SolidMesh:
        """One mesh of the families of a part, all equally likely.

        Raises:
            ConfigError: the part has no family.
            InputError: a folder is missing, or a mesh is unusable.
        """
        if split not in self._solids:
            self._solids[split] = self._of(split)
        return self._solids[split].sample(rng, "test")

    def _of(self, split: str) -> MeshSolids:
        families = self.families.get(split)
        if not families:
            raise ConfigError(
                f"the part {split} has no family of meshes; give split={' or '.join(self.families)}"
            )
        missing = [name for name in families if not (Path(self.root) / name).is_dir()]
        if missing:
            raise InputError(
                f"{self.root} holds no folder {missing[0]} of meshes; give input=FOLDER with it"
            )
        patterns = [f"^{re.escape(name)}/" for name in families]
        return MeshSolids(
            self.root,
            patterns,
            self.leave_out,
            longest=self.longest,
            shortest=self.shortest,
            parts=self.parts,
        )


def _files(root: Path, families: Mapping[str, Sequence[str]]) -> dict[str, list[tuple[str, int]]]:
    """Names of files and when they were written, by part: scenes that are kept depend on them."""
    return {
        part: [
            (path.relative_to(root).as_posix(), path.stat().st_mtime_ns)
            for name in members
            for path in sorted((root / name).rglob("*"))
            if path.is_file()
        ]
        for part, members in families.items()
    }
