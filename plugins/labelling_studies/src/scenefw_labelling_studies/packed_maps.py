"""Many labelled height maps in one small file: a third of a megabyte for 1025 x 1025 vertices.

An .npz of two WebP images per map: the colours, lossy, and without loss an image of heights (two
bytes, in steps) and class ids. For crops to train on; heights are exact to half a step.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image

from scenefw.core.errors import ConfigError, StorageError
from scenefw.core.files import DAMAGED, replacing, unreadable
from scenefw.core.labels import UNKNOWN
from scenefw.data.files.pictures import DAMAGED_PICTURE
from scenefw_tabletops.data.map_crops import LabelledMaps, stacked

STEP = 1e-4
"""Heights are multiples of this (m)."""

QUALITY = 90
"""Of colours, 0 to 100."""

_LOWEST = -0.5  # m
_FORMAT = 2
_HELD = 1000  # bytes of an archive's entry beside its content, at most

Map = tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.int8]]


class PackedMaps:
    """Maps of one split of a file.

    Args:
        path: the file, made by `run=pack_maps`.
        split: train or validation.
        limit: at most this many maps; None = all.

    Raises:
        StorageError: the file is missing, damaged or of another version.
        ConfigError: no such split, or a limit below 1.
    """

    def __init__(
        self,
        path: str | Path = "outputs/fused_maps.npz",
        split: str = "train",
        limit: int | None = None,
    ) -> None:
        self.path, self.split = Path(path), split
        facts = _facts(self.path)
        self.classes = tuple(facts["classes"])
        if split not in facts["maps"]:
            splits = ", ".join(facts["maps"])
            raise ConfigError(f"{path} has no maps of the split '{split}'; there are {splits}")
        if limit is not None and limit < 1:
            raise ConfigError(f"limit = {limit}: expected 1 map or more, or null for all")
        count = facts["maps"][split]
        self._count, self._provenance = count if limit is None else min(count, limit), facts["made"]

    def __len__(self) -> int:
        """Number of maps."""
        return self._count

    def facts(self) -> dict[str, Any]:
        """How they were made, as the file says."""
        return dict(self._provenance)

    def load(self, device: torch.device) -> LabelledMaps:
        """All maps, on a device.

        Raises:
            StorageError: the file is damaged.
        """
        try:
            with np.load(self.path, allow_pickle=False) as file:
                names = [f"{self.split}/{number}" for number in range(len(self))]
                contents = (file[name].tobytes() for name in names)
                with ThreadPoolExecutor() as threads:  # decoding leaves Python to itself
                    return stacked(threads.map(unpacked, contents), device)
        except DAMAGED_PICTURE as error:
            raise _damaged(self.path, error) from error


def packed(colour: NDArray[np.uint8], heights: NDArray[np.float32], labels: NDArray) -> bytes:
    """A map as bytes: colour (V, V, 3), heights (V, V) with NaN = unseen, labels (V, V)."""
    steps = np.rint((np.nan_to_num(heights, nan=_LOWEST) - _LOWEST) / STEP).clip(0, 2**16 - 1)
    valid_labels = np.where(np.isfinite(heights), labels, UNKNOWN)
    planes = (steps.astype(np.uint16) >> 8, steps.astype(np.uint16) & 255, valid_labels - UNKNOWN)
    exact = _encoded(np.stack(planes, axis=-1).astype(np.uint8), lossless=True)
    colour_bytes = _encoded(colour, quality=QUALITY)
    return len(exact).to_bytes(8, "little") + exact + colour_bytes


def unpacked(content: bytes) -> Map:
    """The map of `packed`; what has no label is unseen."""
    middle = 8 + int.from_bytes(content[:8], "little")
    high, low, label = np.moveaxis(_decoded(content[8:middle]), -1, 0)
    labels = (label.astype(np.int16) + UNKNOWN).astype(np.int8)
    steps = high.astype(np.float32) * 256 + low
    heights = np.where(labels == UNKNOWN, np.nan, steps * np.float32(STEP) + np.float32(_LOWEST))
    colour = np.where(labels[..., None] == UNKNOWN, 0, _decoded(content[middle:]))
    return colour.astype(np.uint8), heights.astype(np.float32), labels


def save_maps(
    path: Path | str,
    maps: Iterable[tuple[str, bytes]],
    classes: Sequence[str],
    megabytes: float | None = None,
    provenance: dict[str, Any] | None = None,
) -> dict[str, int]:
    """Writes packed maps until the file would grow beyond a size; how many of each split it holds.

    Args:
        path: the file.
        maps: splits and packed maps.
        classes: names by class id.
        megabytes: most that the file may have; None = any.
        provenance: says of the training maps how they were made, as plain data.

    Raises:
        StorageError: the file can't be written, or no map fits.
    """
    counts: dict[str, int] = {}
    with replacing(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        size = _HELD
        for split, content in maps:
            size += len(content) + _HELD
            if megabytes is not None and size > megabytes * 1e6:
                break
            _write(archive, f"{split}/{counts.get(split, 0)}", np.frombuffer(content, np.uint8))
            counts[split] = counts.get(split, 0) + 1
        if not counts:
            raise StorageError(f"no map fits into {megabytes} MB; allow more")
        facts = {
            "format": _FORMAT,
            "classes": list(classes),
            "maps": counts,
            "made": provenance or {},
        }
        _write(archive, "facts", np.frombuffer(json.dumps(facts).encode(), np.uint8))
    return counts


def _write(archive: zipfile.ZipFile, name: str, array: NDArray[np.uint8]) -> None:
    with archive.open(f"{name}.npy", "w") as file:
        np.lib.format.write_array(file, array)


def _facts(path: Path) -> Mapping[str, Any]:
    try:
        with np.load(path, allow_pickle=False) as file:
            facts: dict[str, Any] = json.loads(file["facts"].tobytes())
    except FileNotFoundError as error:
        raise StorageError(
            f"no packed maps at {path}; make them with `python -m scenefw run=pack_maps "
            "dataset=tabletop_fused_maps`"
        ) from error
    except DAMAGED as error:
        raise _damaged(path, error) from error
    if not isinstance(facts, dict) or not {"classes", "maps", "made"} <= facts.keys():
        raise _damaged(path, ValueError("it does not say what it holds"))
    if facts.get("format") != _FORMAT:
        raise StorageError(
            f"{path} has format {facts.get('format')}, expected {_FORMAT}; pack it again"
        )
    return facts


def _damaged(path: Path, error: Exception) -> StorageError:
    reason = unreadable(error)
    return StorageError(f"{path} holds no packed maps or is damaged ({reason}); pack them again")


def _encoded(image: NDArray[np.uint8], **options: Any) -> bytes:
    file = io.BytesIO()
    Image.fromarray(image).save(file, format="WEBP", method=4, **options)
    return file.getvalue()


def _decoded(content: bytes) -> NDArray[np.uint8]:
    return np.asarray(Image.open(io.BytesIO(content)).convert("RGB"))
