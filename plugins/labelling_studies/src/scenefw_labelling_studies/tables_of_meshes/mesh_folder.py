"""Real models from a folder of meshes with an index: a test domain, never trained on."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenefw.core import rng as streams
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.files import utf8_text
from scenefw.core.tabletop import DESK, SPLITS, TexturedMesh
from scenefw_tabletops.shapes.tabletop import colours
from scenefw_tabletops.shapes.tabletop.parts import Look, face_normals

OTHER = "other"


class MeshFolder:
    """Models of real things, laid flat, at the size that the index states.

    The index is a list of entries with `file` (relative to the index or to its folder's parent),
    `name`, `category` and `extents_m`, the sides of the box about it in metres. A class takes the
    entries whose name or category one of its patterns matches; `other` takes the rest.

    Units: a mesh whose box is about 1000 or 100 times as large as the index says is in millimetres
    or centimetres; other differences are an error. Up: the shortest side becomes upright, so it
    does not matter which axis was up.

    Args:
        root: folder with the index.
        patterns: regular expressions by class, searched in names and categories.
        index: file name of the index.
        leave_out: pattern of names, categories and groups that are no things of a table.
        longest: largest side that finds room on a table (m).
        faces: meshes with more are made coarser.
        seed: of the colours of meshes without any.

    Raises:
        ConfigError: no root is given, or patterns of unknown classes.
        InputError: the index is missing or damaged, or nothing is left of it.
    """

    def __init__(
        self,
        root: str | None,
        patterns: Mapping[str, str],
        index: str = "index.json",
        leave_out: str | None = None,
        longest: float = 0.32,
        faces: int = 4000,
        seed: int = 0,
    ) -> None:
        if root is None:
            raise ConfigError(
                "real models need a folder of meshes with its index; give models.root=FOLDER (of "
                "the scene), or scene=tabletop, which needs no files"
            )
        unknown = sorted(set(patterns) - set(DESK[1:]))
        if unknown:
            raise ConfigError(f"patterns for {', '.join(unknown)}: there are {', '.join(DESK[1:])}")
        self.classes, self.seed, self.faces = DESK, seed, faces
        self._files: list[list[dict[str, Any]]] = [[] for _ in DESK]
        for entry in _entries(Path(root), index):
            words = " ".join(str(entry.get(key, "")) for key in ("name", "category", "group"))
            is_excluded = leave_out is not None and re.search(leave_out, words, re.IGNORECASE)
            if not is_excluded and max(entry["extents_m"]) <= longest:
                self._files[_class_of(words, patterns)].append(entry)
        if not any(self._files):
            raise InputError(f"{root}/{index} names no model of {longest} m or less")
        self._models: dict[tuple[int, int], TexturedMesh] = {}

    def instances(self, label: int, split: str) -> Sequence[int]:
        """Indices of the instances of a class: all of them for the test, else none.

        Raises:
            ConfigError: there is no such split.
        """
        if split not in SPLITS:
            raise ConfigError(f"split '{split}' is unknown; there are {', '.join(SPLITS)}")
        return range(len(self._files[label]) if split == "test" else 0)

    def model(self, label: int, instance: int) -> TexturedMesh:
        """One model; always the same for the same numbers and files.

        Raises:
            InputError: its file can't be read, or is not as large as the index says.
        """
        if (label, instance) not in self._models:
            rng = streams.generator(self.seed, label, instance)
            mesh = read_mesh(self._files[label][instance], self.faces, rng)
            self._models[label, instance] = mesh
        return self._models[label, instance]


def read_mesh(entry: Mapping[str, Any], faces: int, rng: np.random.Generator) -> TexturedMesh:
    """The model of an entry of the index, at rest, z up, in metres.

    Raises:
        InputError: the file can't be read, or is not as large as the index says.
    """
    import trimesh

    path = Path(entry["path"])
    try:
        mesh = trimesh.load(path, force="mesh")
    except Exception as error:  # trimesh passes on whatever its readers raise
        raise InputError(
            f"mesh {path} can't be read ({error}); remove it from the index"
        ) from error
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise InputError(f"mesh {path} holds no triangles; remove it from the index")
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    vertices = _laid(vertices * _unit(np.ptp(vertices, axis=0), entry["extents_m"], path))
    colour = _colours(mesh, rng)
    vertices, triangles, face_rows = _coarser(vertices, np.asarray(mesh.faces), faces)
    normals = face_normals(vertices[triangles])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    flat = np.repeat((normals / np.maximum(lengths, 1e-15))[:, None], 3, axis=1)
    gloss = Look((0, 0, 0), gloss=rng.uniform(0, 0.4)).texture()
    return TexturedMesh(
        vertices, triangles, flat.astype(np.float32), colour[face_rows],
        np.zeros(len(triangles), dtype=np.int32), np.array([gloss], dtype=np.float32),
    )  # fmt: skip


def _entries(root: Path, index: str) -> list[dict[str, Any]]:
    path = root / index
    try:
        listed = json.loads(utf8_text(path))
    except (OSError, ValueError) as error:
        raise InputError(f"{path} can't be read ({error}); expected a list of meshes") from error
    entries = []
    for number, entry in enumerate(listed if isinstance(listed, list) else [None]):
        try:
            size = [float(side) for side in entry["extents_m"]]
            places = [root / entry["file"], root.parent / entry["file"]]
            wrong = None if len(size) == 3 and min(size) > 0 else f"extents_m = {size}"
        except (TypeError, KeyError, ValueError) as error:
            wrong = repr(error)
        if wrong:
            raise InputError(
                f"entry {number} of {path} is unusable ({wrong}); expected file, name and "
                "extents_m, three lengths above 0"
            )
        place = next((candidate for candidate in places if candidate.is_file()), None)
        if place is None:
            raise InputError(f"{path} names {entry['file']}, which is missing; take it out")
        entries.append({**entry, "path": str(place)})
    return entries


def _class_of(words: str, patterns: Mapping[str, str]) -> int:
    for name, pattern in patterns.items():
        if re.search(pattern, words, re.IGNORECASE):
            return DESK.index(name)
    return DESK.index(OTHER)


def _unit(size: NDArray[np.float64], stated: Sequence[float], path: Path) -> float:
    """Metres per unit of a mesh."""
    ratio = float(np.sort(size)[-1] / max(stated))
    for factor in (1.0, 100.0, 1000.0):
        if 0.8 < ratio / factor < 1.25:
            return 1 / factor
    raise InputError(
        f"mesh {path} is {ratio:.3g} times as large as extents_m says; give metres there"
    )


def _laid(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shortest side upright, longest along x, at rest about the origin."""
    order = np.argsort(-np.ptp(vertices, axis=0), kind="stable")
    turned = vertices[:, order]
    if np.linalg.det(np.eye(3)[:, order]) < 0:  # no mirror image
        turned[:, 1] *= -1
    low, high = turned.min(axis=0), turned.max(axis=0)
    return np.asarray(turned - [*(low + high)[:2] / 2, low[2]])


def _coarser(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], max_faces: int
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Vertices within cells joined until at most `max_faces` faces are left; rows of faces kept."""
    face_rows, cell, size = np.arange(len(faces)), 0.0, float(np.ptp(vertices, axis=0).max())
    points, triangles = vertices, faces.astype(np.int64)
    while len(triangles) > max_faces:
        cell = 1.3 * cell if cell else size / 200
        place = np.floor((vertices - vertices.min(axis=0)) / cell).astype(np.int64)
        key = (place[:, 0] * 4096 + place[:, 1]) * 4096 + place[:, 2]
        number = np.unique(key, return_inverse=True)[1].ravel()
        count = np.bincount(number)[:, None]
        sums = [np.bincount(number, weights=vertices[:, k]) for k in range(3)]
        points, triangles = np.column_stack(sums) / count, number[faces]
        a, b, c = triangles.T
        face_rows = np.flatnonzero((a != b) & (b != c) & (c != a))
        triangles = triangles[face_rows]
    return points - [0, 0, points[:, 2].min()], triangles, face_rows


def _colours(mesh: Any, rng: np.random.Generator) -> NDArray[np.float32]:
    """Linear colours (F, 3); one for a mesh without any."""
    if mesh.visual.kind is None:
        colour = np.array(colours.vivid(rng) if rng.random() < 0.5 else colours.plastic(rng))
        return np.broadcast_to(colour.astype(np.float32), (len(mesh.faces), 3)).copy()
    visual = mesh.visual.to_color() if mesh.visual.kind == "texture" else mesh.visual
    srgb = np.asarray(visual.face_colors)[:, :3] / 255
    return np.asarray(srgb**2.2, dtype=np.float32)
