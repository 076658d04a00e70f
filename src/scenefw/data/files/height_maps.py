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
from scenefw.core.labels import FROM_BOTH, NO_SOURCE, UNKNOWN

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
        InputError: the file is missing, damaged, of another version or of another grid, or holds
            numbers that no map has.
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
        **{name: getattr(height_map, name) for name in _FIELDS},
    }
    stored = {name: np.asarray(value) for name, value in content.items() if value is not None}
    if "probabilities" in stored:
        stored["probabilities"] = stored["probabilities"].astype(np.float16)
    return stored


_FIELDS: dict[str, tuple[type[np.generic], float, float]] = {
    "heights": (np.float32, -np.inf, np.inf),
    "colour": (np.uint8, 0, 255),
    "confidence": (np.float32, 0, np.inf),
    "variance": (np.float32, 0, np.inf),
    "probabilities": (np.float32, 0, 1),
    "labels": (np.int32, UNKNOWN, np.iinfo(np.int32).max),
    "sources": (np.uint8, NO_SOURCE, FROM_BOTH),
}
"""Their types in memory, least and largest values."""
_OPTIONAL = ("probabilities", "labels", "sources")
_GAPS = ("heights", "variance")  # NaN where unseen


def _saved(content: dict[str, NDArray[Any]], path: Path, grid: HeightGrid | None) -> SavedMap:
    version = content.get("version")
    if version is None or version.shape != () or float(version) != VERSION:
        raise InputError(
            f"{path} is a map of version {'none' if version is None else version}, expected "
            f"{VERSION}; fuse and save the map again with this version of scenefw"
        )
    missing_keys = [
        key for key in ("grid", *_FIELDS) if key not in content and key not in _OPTIONAL
    ]
    if missing_keys:
        raise InputError(f"map {path} lacks {', '.join(missing_keys)}; save the map again")
    stored_grid = _grid(content["grid"], path)
    if grid is not None and stored_grid != grid:
        raise InputError(
            f"map {path} lies on {stored_grid}, expected {grid}; load it with its own grid or "
            "fuse again"
        )
    classes = tuple(str(name) for name in content.get("classes", ()))
    fields = {name: _array(content, name, stored_grid, len(classes), path) for name in _FIELDS}
    probabilities = fields["probabilities"]
    if probabilities is not None:  # float16 leaves sums near 1
        fields["probabilities"] = probabilities / _sums(probabilities, path)
    states = _states(content, path)
    return SavedMap(HeightMap(stored_grid, **fields, classes=classes), states)  # type: ignore[arg-type]


def _grid(values: NDArray[Any], path: Path) -> HeightGrid:
    if values.shape != (5,) or not np.isfinite(values).all() or (values[[0, -1]] % 1).any():
        raise InputError(f"map {path} has a damaged grid {values.tolist()}; save the map again")
    vertices, extent, x, y, levels = values.tolist()
    try:
        return HeightGrid(int(vertices), extent, (x, y), int(levels))
    except ConfigError as error:
        raise InputError(f"map {path} has a damaged grid: {error}") from error


def _array(
    content: dict[str, NDArray[Any]], name: str, grid: HeightGrid, classes: int, path: Path
) -> NDArray[Any] | None:
    """A field of a map with so many named classes, 0 = unnamed; None if the file lacks it."""
    if name not in content:
        return None
    value, shape = content[name], grid.shape
    expected = {"colour": (*shape, 3), "probabilities": (classes or len(value), *shape)}
    if value.shape != expected.get(name, shape):
        raise InputError(
            f"map {path} has {name} of shape {value.shape}, expected {expected.get(name, shape)} "
            f"for a grid of {grid.vertices} vertices per side; save the map again"
        )
    largest = classes - 1 if name == "labels" and classes else _FIELDS[name][2]
    return _numbers(value, name, largest, path)


def _numbers(value: NDArray[Any], name: str, largest: float, path: Path) -> NDArray[Any]:
    """Values in memory, all of which may be in such a field."""
    kind, least, _ = _FIELDS[name]
    is_whole = not issubclass(kind, np.floating)
    if value.dtype.kind not in ("bui" if is_whole else "buif"):
        numbers = "whole numbers" if is_whole else "numbers"
        raise InputError(
            f"map {path} has {name} of {value.dtype}, expected {numbers}; save the map again"
        )
    with np.errstate(over="ignore"):
        array = value.astype(kind)
    usable = np.isfinite(array) & (value >= least) & (value <= largest)
    if name in _GAPS:
        usable |= np.isnan(array)
    if not usable.all():
        raise InputError(
            f"map {path} has {name} of {value[~usable][0]}, expected finite numbers of {least:g} "
            f"to {largest:g}; save the map again"
        )
    return array


def _sums(probabilities: NDArray[np.float32], path: Path) -> NDArray[np.float32]:
    """Of all classes (V, V)."""
    sums: NDArray[np.float32] = probabilities.sum(axis=0)
    if not (sums > 0).all():
        raise InputError(
            f"map {path} has probabilities that add up to 0 at {(sums <= 0).sum()} vertices, "
            "expected 1; save the map again"
        )
    return sums


def _states(content: dict[str, NDArray[Any]], path: Path) -> dict[str, dict[str, NDArray[Any]]]:
    states: dict[str, dict[str, NDArray[Any]]] = {}
    for key, value in content.items():
        if key.startswith(_PREFIX):
            if value.dtype.kind == "f" and not np.isfinite(value).all():
                raise InputError(
                    f"map {path} has {key} with numbers that are not finite, so nothing resumes "
                    "from it; fuse its recording again"
                )
            name, _, part = key.removeprefix(_PREFIX).partition("/")
            states.setdefault(name, {})[part] = value
    return states
