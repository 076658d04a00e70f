"""Table-top scenes as one compressed file of parameters."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import StorageError
from scenefw.core.files import replacing
from scenefw.core.tabletop import TEXTURE, Light, TabletopItem, TabletopScene

_FORMAT = 1
_WIDTHS = {"items": 6, "lights": 6, "surfaces": 3 + TEXTURE, "ambient": 3, "identity": 2}


def save_tabletops(path: Path | str, scenes: Sequence[TabletopScene]) -> Path:
    """Writes scenes (.npz), all of the same classes; reading gives back exactly these.

    Raises:
        StorageError: scenes of several sets of classes, or the folder can't be written.
    """
    classes = {scene.classes for scene in scenes}
    if len(classes) > 1:
        raise StorageError(f"one file holds scenes of one set of classes, got {sorted(classes)}")
    items = [[i.label, i.instance, i.x, i.y, i.yaw, i.scale] for s in scenes for i in s.items]
    lights = [[*lamp.position, *lamp.intensity] for s in scenes for lamp in s.lights]
    path = Path(path)
    with replacing(path) as temporary:
        np.savez_compressed(
            temporary,
            format=np.array(_FORMAT),
            classes=np.array(classes.pop() if classes else (), dtype=np.str_),
            items=_rows(items, "items"),
            item_count=np.array([len(scene.items) for scene in scenes], dtype=np.int64),
            lights=_rows(lights, "lights"),
            light_count=np.array([len(scene.lights) for scene in scenes], dtype=np.int64),
            surfaces=_rows([scene.surface for scene in scenes], "surfaces"),
            ambient=_rows([scene.ambient for scene in scenes], "ambient"),
            identity=_rows([(s.index, s.seed) for s in scenes], "identity"),
        )
    return path


def load_tabletops(path: Path | str) -> list[TabletopScene]:
    """Reads scenes.

    Raises:
        StorageError: missing, damaged or of another format.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            found = {name: file[name] for name in file.files}
        if int(found["format"]) != _FORMAT:
            raise StorageError(
                f"{path} has format {found['format']}, this version reads {_FORMAT}; make it anew"
            )
        _check(path, found)
        return list(_scenes(found))
    except FileNotFoundError as error:
        raise StorageError(f"no table-top scenes at {path}") from error
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        raise StorageError(f"{path} holds no table-top scenes or is damaged ({error})") from error


def _scenes(found: dict[str, NDArray[Any]]) -> Iterator[TabletopScene]:
    classes = tuple(found["classes"].tolist())
    items = _split(found["items"], found["item_count"])
    lights = _split(found["lights"], found["light_count"])
    for row, (index, seed) in enumerate(found["identity"].astype(np.int64).tolist()):
        yield TabletopScene(
            tuple(TabletopItem(int(i[0]), int(i[1]), *i[2:]) for i in items[row].tolist()),
            tuple(found["surfaces"][row].tolist()),
            tuple(Light(tuple(lamp[:3]), tuple(lamp[3:])) for lamp in lights[row].tolist()),
            tuple(found["ambient"][row].tolist()),
            classes,
            index,
            seed,
        )


def _check(path: Path | str, found: dict[str, NDArray[Any]]) -> None:
    count = len(found["identity"])
    whole = all(found[name].shape[1:] == (width,) for name, width in _WIDTHS.items())
    whole &= len(found["surfaces"]) == len(found["ambient"]) == count
    for name in ("item", "light"):
        counts = found[f"{name}_count"]
        whole &= counts.shape == (count,) and int(counts.sum()) == len(found[f"{name}s"])
    if not whole:
        raise StorageError(f"{path}: arrays of scenes don't fit each other; make the file anew")


def _rows(values: Sequence[Sequence[float]], name: str) -> NDArray[np.float64]:
    return np.array(values, dtype=np.float64).reshape(-1, _WIDTHS[name])


def _split(array: NDArray[Any], counts: NDArray[np.int64]) -> list[NDArray[Any]]:
    return np.split(array, np.cumsum(counts)[:-1])
