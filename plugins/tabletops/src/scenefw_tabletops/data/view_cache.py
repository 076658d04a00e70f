"""Rendered views of a scene on disk: blocks of views and the ground truth, written atomically."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenefw.core.array_files import write_arrays
from scenefw.core.files import DAMAGED
from scenefw.core.height_maps import HeightGrid, HeightMap
from scenefw.core.tabletop import TabletopGeometry
from scenefw.core.types import Camera, Frame

STEP = 5e-5
"""Depth on disk is a multiple of this (m)."""

_BLOCK = 10  # views per file
_FORMAT = 1


@dataclass(frozen=True, eq=False)
class StoredView:
    """Depth (H, W) uint16 in STEPs, colour (H, W, 3) uint8, labels (H, W) int8."""

    depth: NDArray[np.uint16]
    colour: NDArray[np.uint8]
    labels: NDArray[np.int8]

    def frame(self, camera: Camera, name: str) -> Frame:
        """The view as a frame."""
        depth = self.depth.astype(np.float32) * np.float32(STEP)
        return Frame(depth, camera, self.colour, self.labels.astype(np.int32), name)


def exact(frame: Frame) -> StoredView:
    """The stored form of a rendered frame; depth beyond 3.2 m becomes 0, unmeasured."""
    steps = np.rint(frame.depth / STEP)
    depth = np.where(steps < 2**16, steps, 0).astype(np.uint16)
    colour, labels = frame.colour, frame.labels
    if colour is None or labels is None:
        raise TypeError("a renderer of table-top scenes gives colour and labels")
    return StoredView(depth, colour, labels.astype(np.int8))


def key_of(geometry: TabletopGeometry, settings: Sequence[object]) -> str:
    """Digest of a scene and of the settings of its images."""
    digest = hashlib.sha256(repr((_FORMAT, _BLOCK, STEP, *settings)).encode())
    for array in geometry.arrays():
        digest.update(np.ascontiguousarray(array).tobytes())
    digest.update(repr(geometry.classes).encode())
    return digest.hexdigest()[:20]


class ViewCache:
    """The folder of one scene; a damaged file counts as missing and is rewritten.

    Args:
        folder: of this scene alone.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def blocks(self, views: range) -> Iterator[range]:
        """Views grouped by file."""
        start = views.start
        while start < views.stop:
            stop = min((start // _BLOCK + 1) * _BLOCK, views.stop)
            yield range(start, stop)
            start = stop

    def load(self, block: range) -> dict[int, StoredView]:
        """The views of a file by number; empty if the file is missing or unusable."""
        arrays = _read(self._file(block))
        if arrays is None:
            return {}
        parts = (arrays["depth"], arrays["colour"], arrays["labels"])
        rows = zip(arrays["numbers"].tolist(), *parts, strict=True)
        return {number: StoredView(*view) for number, *view in rows}

    def add(self, block: range, views: Mapping[int, StoredView]) -> None:
        """Writes views beside those already in the file.

        Raises:
            StorageError: the folder can't be written.
        """
        all_views = {**self.load(block), **views}
        numbers = sorted(all_views)
        parts = ("depth", "colour", "labels")
        arrays = {part: np.stack([getattr(all_views[i], part) for i in numbers]) for part in parts}
        write_arrays(self._file(block), {"numbers": np.array(numbers, dtype=np.int64), **arrays})

    def load_truth(self, grid: HeightGrid, classes: tuple[str, ...]) -> HeightMap | None:
        """The ground truth, if it is there."""
        arrays = _read(self._truth(grid))
        if arrays is None:
            return None
        return HeightMap(
            grid,
            arrays["heights"],
            arrays["colour"],
            np.ones(grid.shape, dtype=np.float32),
            np.zeros(grid.shape, dtype=np.float32),
            labels=arrays["labels"].astype(np.int32),
            classes=classes,
        )

    def add_truth(self, truth: HeightMap) -> None:
        """Writes the ground truth.

        Raises:
            StorageError: the folder can't be written.
        """
        if truth.labels is None:
            raise TypeError("ground truth has labels")
        arrays = (truth.heights, truth.colour, truth.labels.astype(np.int8))
        contiguous = map(np.ascontiguousarray, arrays)
        names = ("heights", "colour", "labels")
        write_arrays(self._truth(truth.grid), dict(zip(names, contiguous, strict=True)))

    def _file(self, block: range) -> Path:
        return self.folder / f"views_{block.start // _BLOCK:05d}.npz"

    def _truth(self, grid: HeightGrid) -> Path:
        place = hashlib.sha256(repr(grid).encode()).hexdigest()[:8]
        return self.folder / f"truth_{grid.vertices}_{place}.npz"


def _read(path: Path) -> dict[str, NDArray[Any]] | None:
    try:
        with np.load(path, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except DAMAGED:
        return None
