"""Models from a folder of ShapeNetCore: <root>/<synset>/<model>/models/model_normalized.obj."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenefw.core import rng as streams
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.tabletop import SPLITS, TexturedMesh
from scenefw_tabletops.shapes.tabletop.library import split_instances
from scenefw_tabletops.shapes.tabletop.parts import Look, face_normals

_FILE = Path("models") / "model_normalized.obj"


class ShapeNetModels:
    """Models of ShapeNetCore (Chang et al. 2015), laid flat and given the size of real things.

    ShapeNet's y axis points up and its sizes mean nothing: models are turned so that their
    shortest side is upright, and their longest side gets a random length. Colour is per face, of
    its material or of its texture's image at the corners.

    Args:
        root: folder of the synsets.
        synsets: folder of each class by name, in the order of class ids from 1 on.
        lengths: least and greatest longest side by class (m).
        count: instances of each class at most, the first by name; 75 / 10 / 15 % are for training,
            validation and test.
        seed: of the lengths.

    Raises:
        ConfigError: no root is given, or classes without lengths.
        InputError: a synset is missing or has fewer than three models.
    """

    def __init__(
        self,
        root: str | None,
        synsets: Mapping[str, str],
        lengths: Mapping[str, Sequence[float]],
        count: int = 66,
        seed: int = 0,
    ) -> None:
        if root is None:
            raise ConfigError(
                "models of ShapeNet need the folder of ShapeNetCore that holds its synset "
                "folders; give dataset.scenes.models.root=FOLDER, or dataset=tabletop, which needs "
                "no files"
            )
        missing_names = sorted(set(synsets) - set(lengths))
        if missing_names:
            raise ConfigError(
                f"shapenet.lengths has no {', '.join(missing_names)}; give least, greatest"
            )
        self.classes = ("surface", *synsets)
        self.lengths, self.seed = lengths, seed
        self._files = [_models(Path(root) / synsets[name], name)[:count] for name in synsets]
        self._models: dict[tuple[int, int], TexturedMesh] = {}

    def instances(self, label: int, split: str) -> Sequence[int]:
        """Indices of the instances of a class in a split."""
        if split not in SPLITS:
            raise ConfigError(f"split '{split}' is unknown; there are {', '.join(SPLITS)}")
        return split_instances(len(self._files[label - 1]))[split]

    def model(self, label: int, instance: int) -> TexturedMesh:
        """One model; always the same for the same numbers and files.

        Raises:
            InputError: its file can't be read.
        """
        if (label, instance) not in self._models:
            name = self.classes[label]
            rng = streams.generator(self.seed, zlib.crc32(name.encode()), instance)
            minimum, maximum = self.lengths[name]
            length = float(rng.uniform(minimum, maximum))
            self._models[label, instance] = read_model(self._files[label - 1][instance], length)
        return self._models[label, instance]


def read_model(path: Path, length: float) -> TexturedMesh:
    """A model from a file of any format that trimesh reads, y up, its longest side of `length` (m).

    Raises:
        InputError: the file can't be read or holds no triangles.
    """
    import trimesh

    try:
        with path.open("rb") as file:
            scene = trimesh.load_scene(file, path.suffix[1:], resolver=_resolver(path))
        geometries = scene.dump()
        meshes = [m for m in geometries if isinstance(m, trimesh.Trimesh) and len(m.faces)]
    except Exception as error:  # trimesh passes on whatever its readers raise
        raise InputError(f"model {path} can't be read ({error}); remove its folder") from error
    if not meshes:
        raise InputError(f"model {path} holds no triangles; remove its folder")
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertices = _lay_flat(np.concatenate([mesh.vertices for mesh in meshes]), length)
    faces = np.concatenate([m.faces + start for m, start in zip(meshes, starts, strict=False)])
    faces = faces.astype(np.int64)
    colours = np.concatenate([_colours(mesh) for mesh in meshes])
    normals = face_normals(vertices[faces])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    solid = lengths[:, 0] > 0
    normals = normals / np.where(lengths > 0, lengths, 1)
    return TexturedMesh(
        vertices,
        faces[solid],
        np.repeat(normals[solid, None], 3, axis=1).astype(np.float32),
        colours[solid],
        np.zeros(int(solid.sum()), dtype=np.int32),
        np.array([Look((0, 0, 0), gloss=0.1).texture()], dtype=np.float32),
    )


def _resolver(path: Path) -> Any:
    """Finds materials and images only beside a model's file or its folder.

    ShapeNet's materials name images as ../images/texture0.jpg, which trimesh's own refuses.
    """
    from trimesh.resolvers import FilePathResolver

    base, root = path.parent.resolve(), path.parent.parent.resolve()

    class ModelFolder(FilePathResolver):
        def get(self, name: str) -> bytes:
            target = (base / name.strip().replace("\\", "/")).resolve()
            if not target.is_relative_to(root):
                raise FileNotFoundError(name)
            return target.read_bytes()

    return ModelFolder(str(path))


def _models(folder: Path, name: str) -> list[Path]:
    if not folder.is_dir():
        raise InputError(
            f"no folder {folder} for class {name}; set shapenet.root to the folder that holds the "
            "synsets, and shapenet.synsets to their names"
        )
    paths = sorted(path / _FILE for path in folder.iterdir() if (path / _FILE).is_file())
    if len(paths) < len(SPLITS):
        raise InputError(
            f"{folder} has {len(paths)} models with {_FILE}, expected {len(SPLITS)} or more"
        )
    return paths


def _lay_flat(vertices: NDArray[np.float64], length: float) -> NDArray[np.float64]:
    """Z up, shortest side upright, longest along x, at rest about the origin."""
    upright = np.asarray(vertices, dtype=np.float64) @ [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    size = np.ptp(upright, axis=0)
    if size[2] > 1.001 * size.min():  # turned about the other axis, to avoid a mirror image
        if size[0] < size[1]:
            upright = upright @ [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]
        else:
            upright = upright @ [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
        size = np.ptp(upright, axis=0)
    if size[1] > size[0]:
        upright = upright @ [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
    low, high = upright.min(axis=0), upright.max(axis=0)
    middle = np.array([*(low + high)[:2] / 2, low[2]])
    flat_vertices: NDArray[np.float64] = (upright - middle) * (
        length / max(float((high - low).max()), 1e-9)
    )
    return flat_vertices


def _colours(mesh: Any) -> NDArray[np.float32]:
    """Linear colours (F, 3): the mean of the image at the corners, or the material's colour."""
    visual, faces = mesh.visual, mesh.faces
    if visual.kind != "texture":
        rgba = np.asarray(visual.face_colors)
    elif visual.uv is None or getattr(visual.material, "image", None) is None:
        rgba = np.broadcast_to(visual.material.main_color, (len(faces), 4))
    else:
        rgba = visual.material.to_color(visual.uv)[faces].astype(np.float64).mean(axis=1)
    linear: NDArray[np.float32] = ((rgba[:, :3] / 255) ** 2.2).astype(np.float32)
    return linear
