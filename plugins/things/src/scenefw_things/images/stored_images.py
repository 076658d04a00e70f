"""Simulated images on disk, with the owner of each pixel, as trainings read them at random."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.lib.format import open_memmap

from scenefw.core.errors import StorageError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

OBSTACLE = 128
"""Owners from here on are no objects."""
DEPTH_UNIT = 1e-4
"""Metres of one step of stored depth."""
_FACTS = "images.json"
_KINDS: Mapping[str, tuple[type, tuple[int, ...]]] = {
    "depth": (np.uint16, (0, 0)),
    "owners": (np.uint8, (0, 0)),
    "colour": (np.uint8, (0, 0, 3)),
    "intrinsics": (np.float32, (4,)),
    "poses": (np.float32, (4, 4)),
}


@dataclass(frozen=True)
class StoredImages:
    """N images of one size, mapped into memory, where what is read stays while there is room.

    Args:
        folder: they lie in.
        facts: how they were made, as plain data; `images` of them are finished.
        depth: (N, H, W) uint16, z-depth in steps of 0.1 mm, 0 = nothing.
        owners: (N, H, W) uint8, 0 = none, 1 to 127 = an object, 128 on = an obstacle.
        colour: (N, H, W, 3) uint8.
        intrinsics: (N, 4) float32: fx, fy, cx, cy.
        poses: (N, 4, 4) float32, the camera in a world whose floor is z = 0.
    """

    folder: Path
    facts: dict[str, Any]
    depth: NDArray[np.uint16]
    owners: NDArray[np.uint8]
    colour: NDArray[np.uint8]
    intrinsics: NDArray[np.float32]
    poses: NDArray[np.float32]

    def __len__(self) -> int:
        """Images that are finished."""
        return int(self.facts["images"])

    @property
    def size(self) -> tuple[int, int]:
        """Width and height (pixels)."""
        height, width = self.depth.shape[1:]
        return width, height

    @classmethod
    def open(cls, folder: Path | str, *, writable: bool = False) -> StoredImages:
        """The images of a folder.

        Raises:
            StorageError: there are none, or a file is missing or damaged.
        """
        folder = Path(folder)
        try:
            facts = json.loads((folder / _FACTS).read_text(encoding="utf-8"))
            finished = int(facts["images"])
            arrays = _arrays(folder, writable=writable)
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise StorageError(f"{folder} holds no images ({error}); make them anew") from error
        if any(len(values) < finished for values in arrays.values()):
            raise StorageError(f"{folder} lacks some of its {finished} images; make them anew")
        return cls(folder, facts, **arrays)

    @classmethod
    def create(
        cls, folder: Path | str, count: int, size: tuple[int, int], facts: Mapping[str, Any]
    ) -> StoredImages:
        """Room for images in a folder, or those of an interrupted call with the same facts.

        Raises:
            StorageError: the folder holds images that were made otherwise.
        """
        folder, (width, height) = Path(folder), size
        stored = {"count": count, "size": [width, height], **facts}
        if (folder / _FACTS).is_file():
            images = cls.open(folder, writable=True)
            if {**stored, "images": len(images)} != images.facts:
                raise StorageError(
                    f"{folder} holds images that were made otherwise; delete it, or give another"
                )
            return images
        folder.mkdir(parents=True, exist_ok=True)
        for name, (kind, shape) in _KINDS.items():
            free = iter((height, width))
            sides = tuple(side or next(free) for side in shape)
            open_memmap(folder / f"{name}.npy", mode="w+", dtype=kind, shape=(count, *sides))
        images = cls(folder, {**stored, "images": 0}, **_arrays(folder, writable=True))
        images.save()
        return images

    def save(self) -> None:
        """Writes all that is in memory, and last how many images are finished."""
        for name in _KINDS:
            values: np.memmap[Any, Any] = getattr(self, name)
            values.flush()
        (self.folder / _FACTS).write_text(json.dumps(self.facts, indent=1), encoding="utf-8")


def _arrays(folder: Path, *, writable: bool) -> dict[str, NDArray[Any]]:
    return {
        name: np.load(folder / f"{name}.npy", mmap_mode="r+" if writable else "r")
        for name in _KINDS
    }
