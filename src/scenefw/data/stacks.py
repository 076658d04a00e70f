"""Scenes of superquadrics as parameters: the shipped data sets, or those of `run=generate`."""

import dataclasses
import json
from collections.abc import Callable, Sequence
from importlib import resources
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from scenefw.core import geometry
from scenefw.core.batches import SceneParameters
from scenefw.core.errors import ConfigError, StorageError
from scenefw.kernels.transfer import to_device
from scenefw.representations.volumes import require_solids

SPLITS = ("train", "val", "test")
SHIPPED = {"stacks": "superquadric_stacks.npz", "scattered": "superquadric_scattered.npz"}
_SHAPES = {"half_axes": 3, "exponents": 3, "positions": 3, "quaternions": 4}


class StackScenes:
    """Scenes of one split of one or several data sets of superquadrics.

    Args:
        path: the `.npz` of a data set, or the name of a shipped one (stacks, scattered); several
            are put one after the other; None means the shipped stacks.
        split: train, val, test or all.
        limit: at most this many scenes of each data set, the first of the split; None means all.

    Raises:
        StorageError: the file is missing, damaged or no data set of stacks.
        ConfigError: no such split, or it holds no scene.
    """

    def __init__(
        self,
        path: Path | str | Sequence[Path | str] | None = None,
        split: str = "train",
        limit: int | None = None,
    ) -> None:
        several = path if isinstance(path, Sequence) and not isinstance(path, str) else [path]
        self.paths = [_file(entry) for entry in several]
        parts = [_split(file, split, limit) for file in self.paths]
        self.sizes = {_name(p): len(a["index"]) for p, a in zip(self.paths, parts, strict=True)}
        arrays = _joined(parts)
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
        chosen = torch.as_tensor(indices, dtype=torch.int64).cpu()
        (rows,) = to_device([chosen.numpy()], device)
        return _each(self._on(device), lambda field: field.index_select(0, rows))

    def _on(self, device: torch.device) -> SceneParameters:
        if device not in self._resident:
            everything = self._resident[torch.device("cpu")]
            require_solids(everything)
            self._resident[device] = _each(everything, lambda field: field.to(device))
        return self._resident[device]

    def manifest(self) -> dict[str, object]:
        """How the first data set was made, from the file beside it; empty if there is none."""
        path = self.paths[0].with_suffix(".json")
        return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def shipped_scenes(name: str = "stacks") -> Path:
    """A data set that comes with the package: stacks or scattered."""
    return Path(str(resources.files("scenefw") / "assets" / SHIPPED[name]))


def _file(path: Path | str | None) -> Path:
    name = "stacks" if path is None else str(path)
    return shipped_scenes(name) if name in SHIPPED else Path(name)


def _name(path: Path) -> str:
    """Name of a data set: its own if it ships, else its file's."""
    return next((name for name, file in SHIPPED.items() if path.name == file), path.stem)


def _split(path: Path, split: str, limit: int | None) -> dict[str, np.ndarray]:
    """The arrays of a data set, one row per scene of a split."""
    arrays = _read(path)
    rows = _rows(arrays["split"], split, limit, path)
    return {name: array[rows] for name, array in arrays.items()}


def _joined(sets: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Joins data sets; scenes with fewer objects get empty slots."""
    slots = max(arrays["half_axes"].shape[1] for arrays in sets)
    return {
        name: np.concatenate([_padded(a[name], slots) for a in sets])
        for name in (*_SHAPES, "masses", "count", "index")
    }


def _padded(array: np.ndarray, slots: int) -> np.ndarray:
    if array.ndim < 2:
        return array
    missing = slots - array.shape[1]
    return np.pad(array, [(0, 0), (0, missing), *[(0, 0)] * (array.ndim - 2)])


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


def _each(parameters: SceneParameters, change: Callable[[Tensor], Tensor]) -> SceneParameters:
    names = (field.name for field in dataclasses.fields(parameters))
    return SceneParameters(*(change(getattr(parameters, name)) for name in names))


def _read(path: Path) -> dict[str, np.ndarray]:
    try:
        with np.load(path, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
    except FileNotFoundError as error:
        raise StorageError(
            f"no data set at {path}; make one with `python -m scenefw run=generate`, or leave "
            "dataset.path=null to use the shipped one"
        ) from error
    except Exception as error:  # numpy raises many kinds for damaged archives
        raise StorageError(
            f"the data set {path} cannot be read ({type(error).__name__}); generate it again"
        ) from error
    _require_arrays(arrays, path)
    return arrays


def _require_arrays(arrays: dict[str, np.ndarray], path: Path) -> None:
    missing = {*_SHAPES, "masses", "count", "index", "split"} - arrays.keys()
    if missing:
        raise StorageError(
            f"{path} lacks {', '.join(sorted(missing))}, so it is not a data set of stacks; give "
            "an .npz made by `run=generate`"
        )
    for name, width in _SHAPES.items():
        array = arrays[name]
        if array.ndim != 3 or array.shape[-1] != width or not np.isfinite(array).all():
            raise StorageError(
                f"{name} in {path} has shape {array.shape} or holds values that are not finite, "
                f"expected (scenes, objects, {width}); generate the data set again"
            )


def _rows(splits: np.ndarray, split: str, limit: int | None, path: Path) -> np.ndarray:
    if split != "all" and split not in SPLITS:
        raise ConfigError(f"split is {split!r}, expected one of all, {', '.join(SPLITS)}")
    if limit is not None and limit < 1:
        raise ConfigError(f"the limit of scenes is {limit}, expected at least 1 or null for all")
    everything = np.arange(len(splits))
    rows = everything if split == "all" else everything[splits == SPLITS.index(split)]
    if len(rows) == 0:
        raise ConfigError(f"{path} holds no scene of the split {split}; generate more scenes")
    return rows[:limit]
