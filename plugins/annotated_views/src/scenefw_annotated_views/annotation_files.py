"""What formats of annotated views share: images, depth in 16 bits, lists of scenes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from scenefw.core.errors import StorageError
from scenefw.core.files import in_order, replacing, utf8_text, write_text
from scenefw.core.types import Float32
from scenefw_annotated_views.annotations import AnnotatedView

DEPTH_UNIT = 1e-4
"""Metres per unit of depth images."""

_MOST = 2**16 - 1


def write_image(path: Path, values: NDArray[Any]) -> None:
    """Writes an image, of 8 or 16 bits."""
    with replacing(path) as temporary:
        Image.fromarray(np.ascontiguousarray(values)).save(temporary)


def write_frame(folder: Path, name: str, view: AnnotatedView) -> None:
    """Writes `depth/NAME.png`, and `rgb/NAME.png` where there is colour."""
    write_image(folder / "depth" / f"{name}.png", in_units(view.frame.depth))
    if view.frame.colour is not None:
        write_image(folder / "rgb" / f"{name}.png", view.frame.colour)


def in_units(depth: Float32) -> NDArray[np.uint16]:
    """Depth in `DEPTH_UNIT`; 0, nothing measured, where it is too far for 16 bits."""
    units = np.rint(depth / DEPTH_UNIT)
    return np.where(units <= _MOST, units, 0).astype(np.uint16)


def write_json(path: Path, content: Any) -> None:
    """Writes JSON, in place of what was there."""
    write_text(path, json.dumps(content) + "\n")


def scene_folders(root: Path, split: str) -> list[Path]:
    """Folders of scenes in the order of their numbers."""
    return in_order(path for path in (root / split).iterdir() if path.name.isdecimal())


def read_json(path: Path) -> Any:
    """What `write_json` wrote.

    Raises:
        StorageError: it is missing or damaged.
    """
    try:
        return json.loads(utf8_text(path))
    except (OSError, ValueError) as error:
        raise StorageError(
            f"cannot read {path} ({error}); remove the folder {path.parent} and export again"
        ) from error
