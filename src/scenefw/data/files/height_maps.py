"""Height maps as files: one .npz each, with the states to resume from."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenefw.core.array_files import write_arrays
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.files import DAMAGED, unreadable
from scenefw.core.height_maps import HeightGrid, HeightMap

VERSION = 1
_PREFIX = "state/"

States = Mapping[str, Mapping[str, NDArray[Any]]]


@dataclass(frozen=True)
class SavedMap:
    """What a map file holds.

    Args:
        height_map: the map.
        states: of the fusions that made it, by name, as they were given to `save_map`.
    """

    height_map: HeightMap
    states: Mapping[str, Mapping[str, NDArray[Any]]] = field(default_factory=dict)


def save_map(path: Path | str, height_map: HeightMap, states: States | None = None) -> Path:
    """Writes a map to a .npz file, atomically; probabilities are kept as float16.

    Args:
        path: the file; the suffix .npz is added if missing.
        height_map: the map.
        states: `state()` of the fusions by name, e.g. {"heights": ..., "labels": ...}. With them a
            fusion resumes as if never interrupted; the map alone loses what vertices shared (the
            couplings of the normal equations) and certainty beyond float16.

    Raises:
        StorageError: the file can't be written.
    """
    path = Path(path)
    target = path if path.suffix == ".npz" else path.with_name(path.name + ".npz")
    content = _content(height_map)
    for name, state in (states or {}).items():
        content |= {f"{_PREFIX}{name}/{key}": np.asarray(value) for key, value in state.items()}
    write_arrays(target, content)
    return target


def load_map(path: Path | str, grid: HeightGrid | None = None) -> SavedMap:
    """Reads a map file.

    Args:
        path: a .npz file of `save_map`.
        grid: what the map must lie on; None = any.

    Raises:
        InputError: the file is missing, damaged, of another version or of another grid.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"no map file {path}; give the .npz file of a saved height map")
    try:
        with np.load(path, allow_pickle=False) as file:
            content = {name: file[name] for name in file.files}
        return _saved(content, path, grid)
    except (*DAMAGED, TypeError) as error:
        reason = unreadable(error, "is the file complete? save the map again")
        raise InputError(f"cannot read map {path}: {reason}") from error


def _content(height_map: HeightMap) -> dict[str, NDArray[Any]]:
    grid = height_map.grid
    content = {
        "version": np.array(VERSION),
        "grid": np.array([grid.vertices, grid.extent, *grid.lower, grid.levels], dtype=np.float64),
        "classes": np.array(height_map.classes, dtype=np.str_),
        **{name: getattr(height_map, name) for name in _TYPES},
    }
    stored = {name: np.asarray(value) for name, value in content.items() if value is not None}
    if "probabilities" in stored:
        stored["probabilities"] = stored["probabilities"].astype(np.float16)
    return stored


_TYPES: dict[str, type[np.generic]] = {
    "heights": np.float32,
    "colour": np.uint8,
    "confidence": np.float32,
    "variance": np.float32,
    "probabilities": np.float32,
    "labels": np.int32,
    "sources": np.uint8,
}
_OPTIONAL = ("probabilities", "labels", "sources")


def _saved(content: dict[str, NDArray[Any]], path: Path, grid: HeightGrid | None) -> SavedMap:
    version = content.get("version")
    if version is None or version.shape != () or int(version) != VERSION:
        raise InputError(
            f"{path} is a map of version {'none' if version is None else version}, expected "
            f"{VERSION}; fuse and save the map again with this version of scenefw"
        )
    missing_keys = [key for key in ("grid", *_TYPES) if key not in content and key not in _OPTIONAL]
    if missing_keys:
        raise InputError(f"map {path} lacks {', '.join(missing_keys)}; save the map again")
    stored_grid = _grid(content["grid"], path)
    if grid is not None and stored_grid != grid:
        raise InputError(
            f"map {path} lies on {stored_grid}, expected {grid}; load it with its own grid or "
            "fuse again"
        )
    fields = {name: _array(content, name, kind, stored_grid, path) for name, kind in _TYPES.items()}
    probabilities = fields["probabilities"]
    if probabilities is not None:  # float16 leaves sums near 1
        fields["probabilities"] = probabilities / probabilities.sum(axis=0)
    classes = tuple(str(name) for name in content.get("classes", ()))
    return SavedMap(HeightMap(stored_grid, **fields, classes=classes), _states(content))  # type: ignore[arg-type]


def _grid(values: NDArray[Any], path: Path) -> HeightGrid:
    if values.shape != (5,):
        raise InputError(f"map {path} has a damaged grid {values.tolist()}; save the map again")
    vertices, extent, x, y, levels = values.tolist()
    try:
        return HeightGrid(int(vertices), extent, (x, y), int(levels))
    except ConfigError as error:
        raise InputError(f"map {path} has a damaged grid: {error}") from error


def _array(
    content: dict[str, NDArray[Any]],
    name: str,
    kind: type[np.generic],
    grid: HeightGrid,
    path: Path,
) -> NDArray[Any] | None:
    if name not in content:
        return None
    value = content[name]
    plane = {"colour": value.shape[:-1], "probabilities": value.shape[1:]}.get(name, value.shape)
    if plane != grid.shape:
        raise InputError(
            f"map {path} has {name} of shape {value.shape}, but a grid of {grid.vertices} vertices "
            "per side; save the map again"
        )
    return value.astype(kind)


def _states(content: dict[str, NDArray[Any]]) -> dict[str, dict[str, NDArray[Any]]]:
    states: dict[str, dict[str, NDArray[Any]]] = {}
    for key, value in content.items():
        if key.startswith(_PREFIX):
            name, _, part = key.removeprefix(_PREFIX).partition("/")
            states.setdefault(name, {})[part] = value
    return states
