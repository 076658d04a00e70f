"""Scenes of superquadrics as parameters: the shipped data sets, or those of `run=generate`."""

import dataclasses
import hashlib
import json
from collections import Counter
from collections.abc import Callable, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from torch import Tensor

from scenefw.core import geometry
from scenefw.core.batches import SceneParameters
from scenefw.core.errors import ConfigError, StorageError
from scenefw.core.final_split import FINAL, look
from scenefw.core.types import Pose, SceneObject
from scenefw.kernels.transfer import to_device
from scenefw.representations.volumes import require_solids
from scenefw.scenes.splits import SPLITS
from scenefw.scenes.storage import StoredScenes, load_scenes
from scenefw.shapes.superquadric import Superquadric

SHIPPED = {
    "stacks_v2": "superquadric_stacks_v2.npz",
    "scattered_v2": "superquadric_scattered_v2.npz",
    "large_stacks_v2": "superquadric_large_stacks_v2.npz",
    "stacks_of_six_v2": "superquadric_stacks_of_six_v2.npz",
    "few_v2": "superquadric_few_v2.npz",
    "wide_v2": "superquadric_wide_v2.npz",
    "stacks_v1": "superquadric_stacks.npz",
    "scattered_v1": "superquadric_scattered.npz",
}
FINAL_PARTS = tuple(name for name in SHIPPED if name.endswith("_v2"))
_LATEST = "_v2"  # what a name without a version means


class SceneSet(Protocol):
    """Scenes of one split of a data set, to look at and to simulate."""

    @property
    def indices(self) -> np.ndarray:
        """(S,) numbers of the scenes in the data set."""

    def __len__(self) -> int:
        """Scenes of the split."""

    def objects(self, row: int) -> tuple[SceneObject, ...]:
        """The objects of the scene at a position in this split, as rigid bodies."""

    def parameters(
        self, indices: Tensor | list[int], device: torch.device | str | None = None
    ) -> Any:
        """The scenes of the given positions, as a `ViewMaker` takes them."""


class StackScenes:
    """Scenes of one split of one or several data sets of superquadrics.

    Args:
        path: the `.npz` of a data set, or the name of a shipped one (stacks_v2, scattered_v2,
            large_stacks_v2, stacks_of_six_v2, few_v2, wide_v2, stacks_v1, scattered_v1; without a
            version: v2); several are put one after the other; None means stacks_v2.
        split: train, val, test, all of these, or final, which only releases may read
            (`core.final_split`) and which is a file of its own.
        limit: at most this many scenes of each data set, the first of the split; None means all.

    Raises:
        StorageError: the file is missing, damaged or no data set of stacks.
        ConfigError: no such split, it holds no scene, or it is final and that is not open.
    """

    def __init__(
        self,
        path: Path | str | Sequence[Path | str] | None = None,
        split: str = "train",
        limit: int | None = None,
    ) -> None:
        several = path if isinstance(path, Sequence) and not isinstance(path, str) else [path]
        self.paths = [data_file(entry, split) for entry in several]
        parts = [_split(file, split, limit) for file in self.paths]
        self.sizes = _sizes(self.paths, [len(arrays["index"]) for arrays in parts])
        arrays = _join(parts)
        self.split = split
        self.indices = arrays["index"]
        self.masses = arrays["masses"]
        self._resident = {torch.device("cpu"): _parameters(arrays)}

    def __len__(self) -> int:
        """Scenes of the split."""
        return len(self.indices)

    def parameters(
        self, indices: Tensor | list[int], device: torch.device | str | None = None
    ) -> SceneParameters:
        """The scenes of the given positions in this split, on `device` (default: the CPU).

        All scenes stay on every device that asked for some, so that nothing but the positions
        travels afterwards, and nothing waits for that.

        Raises:
            InputError: on the way to another device, an object is not a convex solid.
        """
        device = torch.device(device or "cpu")
        positions = torch.as_tensor(indices, dtype=torch.int64).cpu()
        (rows,) = to_device([positions.numpy()], device)
        return _map_fields(self._on(device), lambda field: field.index_select(0, rows))

    def objects(self, row: int) -> tuple[SceneObject, ...]:
        """The objects of the scene at a position in this split, as rigid bodies."""
        scene = _map_fields(self._resident[torch.device("cpu")], lambda field: field[row])
        axes, exponents, rotations, positions = (
            getattr(scene, name).numpy().astype(np.float64)
            for name in ("half_axes", "exponents", "rotations", "positions")
        )
        return tuple(
            SceneObject(
                Superquadric(axes[i], exponents[i]),
                Pose(positions[i], geometry.quaternion_from_rotation(rotations[i])),
                float(self.masses[row, i]),
            )
            for i in np.flatnonzero(scene.present.numpy())
        )

    def _on(self, device: torch.device) -> SceneParameters:
        if device not in self._resident:
            scenes = self._resident[torch.device("cpu")]
            require_solids(scenes)
            self._resident[device] = _map_fields(scenes, lambda field: field.to(device))
        return self._resident[device]

    def manifest(self) -> dict[str, object]:
        """How the first data set was made, from the file beside it; empty if there is none."""
        path = self.paths[0].with_suffix(".json")
        return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def shipped_scenes(name: str = "stacks", split: str = "train") -> Path:
    """The file of a data set that comes with the package; its final part is another file.

    Raises:
        ConfigError: the package has no such data set.
    """
    full_name = name if name in SHIPPED else f"{name}{_LATEST}"
    if full_name not in SHIPPED:
        raise ConfigError(f"no data set {name} ships; there are {', '.join(SHIPPED)}")
    if split == FINAL and full_name not in FINAL_PARTS:
        raise ConfigError(f"{full_name} has no final part; there are {', '.join(FINAL_PARTS)}")
    file = SHIPPED[full_name]
    file = file.replace(".npz", "_final.npz") if split == FINAL else file
    return Path(str(resources.files("scenefw") / "assets" / file))


def data_file(path: Path | str | None, split: str = "train") -> Path:
    """The file of a data set: a path, or the name of one that ships (None: stacks)."""
    name = "stacks" if path is None else str(path)
    ships = name in SHIPPED or f"{name}{_LATEST}" in SHIPPED
    return shipped_scenes(name, split) if ships else Path(name)


def _name(path: Path) -> str:
    """Name of a data set: its own if it ships, else its file's."""
    return next((name for name, file in SHIPPED.items() if path.name == file), path.stem)


def _sizes(paths: Sequence[Path], counts: Sequence[int]) -> dict[str, int]:
    """Scenes by the name of their data set; files of one name are told apart by their paths."""
    files = Counter(_name(path) for path in {*paths})
    sizes: Counter[str] = Counter()
    for path, count in zip(paths, counts, strict=True):
        name = _name(path)
        sizes[name if files[name] == 1 else str(path)] += count
    return dict(sizes)


def _split(path: Path, split: str, limit: int | None) -> dict[str, np.ndarray]:
    """The arrays of a data set, one row per scene of a split."""
    require_open(path, split)
    arrays = _read(path)
    rows = rows_of(arrays["split"], split, limit, path)
    return {name: array[rows] for name, array in arrays.items()}


def _join(sets: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Joins data sets; scenes with fewer objects get empty slots."""
    slots = max(arrays["half_axes"].shape[1] for arrays in sets)
    return {name: np.concatenate([_padded(a[name], slots) for a in sets]) for name in sets[0]}


def _padded(array: np.ndarray, slots: int) -> np.ndarray:
    if array.ndim < 2:
        return array
    padding = slots - array.shape[1]
    return np.pad(array, [(0, 0), (0, padding), *[(0, 0)] * (array.ndim - 2)])


def _parameters(arrays: dict[str, np.ndarray]) -> SceneParameters:
    """All scenes; empty slots may hold anything."""
    quaternions = arrays["quaternions"].astype(np.float64)
    quaternions[(quaternions == 0).all(axis=-1)] = (1.0, 0.0, 0.0, 0.0)
    slots = np.arange(quaternions.shape[1])
    fields = (
        arrays["half_axes"],
        arrays["exponents"],
        geometry.rotation_from_quaternion(quaternions),
        arrays["positions"],
    )
    present = slots < arrays["count"].astype(np.int64)[:, None]
    numbers = [torch.from_numpy(field.astype(np.float32)) for field in fields]
    return SceneParameters(*[*numbers, torch.from_numpy(present)])


def _map_fields(parameters: SceneParameters, change: Callable[[Tensor], Tensor]) -> SceneParameters:
    names = (field.name for field in dataclasses.fields(parameters))
    return SceneParameters(*(change(getattr(parameters, name)) for name in names))


def require_open(path: Path, split: str) -> None:
    """Notes that the final part of a file is about to be read.

    Raises:
        ConfigError: it is the final split, and that is not open.
    """
    if split == FINAL:
        look(path.stem, hashlib.sha256(_bytes(path)).hexdigest())


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError:  # reading the arrays says what is wrong
        return b""


def _read(path: Path) -> dict[str, np.ndarray]:
    if not path.exists():
        raise StorageError(
            f"no data set at {path}; make one with `python -m scenefw run=generate` (those of the "
            "thesis's chapter 6 with experiment=thesis/scenes_of_six or "
            "thesis/scenes_of_four_to_eight), or leave dataset.path=null to use the shipped one "
            f"(also by name: {', '.join(SHIPPED)})"
        )
    stored = load_scenes(path)
    if not isinstance(stored, StoredScenes):
        raise StorageError(f"{path} holds no stacks of superquadrics; give one of scene=stacks")
    return stored.arrays()


def rows_of(splits: np.ndarray, split: str, limit: int | None, path: Path) -> np.ndarray:
    """The first `limit` scenes of a split, as rows of a file; `all` leaves out the final ones.

    Args:
        splits: (S,) of each scene, position in `SPLITS`.
        split: train, val, test, final or all.
        limit: None means all.
        path: of the file, for messages.

    Raises:
        ConfigError: no such split, it holds no scene, or a limit below 1.
    """
    if split != "all" and split not in SPLITS:
        raise ConfigError(f"split is {split!r}, expected one of all, {', '.join(SPLITS)}")
    if limit is not None and limit < 1:
        raise ConfigError(f"the limit of scenes is {limit}, expected at least 1 or null for all")
    row_numbers = np.arange(len(splits))
    final = splits == SPLITS.index(FINAL)
    rows = row_numbers[~final if split == "all" else splits == SPLITS.index(split)]
    if len(rows) == 0:
        raise ConfigError(f"{path} holds no scene of the split {split}; generate more scenes")
    return rows[:limit]
