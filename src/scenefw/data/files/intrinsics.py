"""Camera intrinsics from small files: JSON, YAML or text."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import yaml
from numpy.typing import ArrayLike, NDArray

from scenefw.core.errors import InputError
from scenefw.core.types import Camera

_KEYS = ("K", "camera_matrix", "intrinsic_matrix", "intrinsics", "cam_K", "data")
_STRUCTURED = {".json", ".yaml", ".yml"}
_EXPECTED = "give a 3 x 3 matrix K, or fx, fy, cx, cy"

Intrinsics: TypeAlias = ArrayLike | Camera | Mapping[str, Any] | str | Path
"""Whatever holds the intrinsics of an image: see `intrinsic_matrix`."""


def read_intrinsics(path: Path) -> NDArray[np.float64]:
    """Intrinsic matrix K (3, 3) in pixels from a .json, .yaml, .yml or .txt file.

    JSON and YAML hold either `fx, fy, cx, cy` or a matrix under one of `K`, `camera_matrix`,
    `intrinsic_matrix`, `intrinsics`, `cam_K`, nested (3 x 3), flat (9, row by row) or as ROS writes
    it (`data`). Text holds nine numbers, or four in the order fx fy cx cy.

    Raises:
        InputError: the file is missing, of another format, or holds something else.
    """
    if not path.is_file():
        raise InputError(f"no intrinsics file {path}; {_EXPECTED} in a .json, .yaml or .txt file")
    suffix = path.suffix.lower()
    try:
        if suffix in _STRUCTURED:
            return _from_content(_structured(path), path)
        text = path.read_text(encoding="utf-8-sig")
        if suffix == ".txt":
            return _from_numbers(text.replace(",", " ").split(), path)
    except (ValueError, TypeError, yaml.YAMLError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"cannot read intrinsics {path}: {reason}; {_EXPECTED}") from error
    raise InputError(f"unknown intrinsics format '{suffix}' of {path}; use .json, .yaml or .txt")


def intrinsic_matrix(intrinsics: Intrinsics, name: str) -> NDArray[np.float64]:
    """Intrinsic matrix K (3, 3) in pixels of whatever holds it.

    Args:
        intrinsics: K itself, a camera, `{"fx": ..., "fy": ..., "cx": ..., "cy": ...}` or a matrix
            by one of the names that files use, the four numbers fx fy cx cy, or the path of a file.
        name: of the image, for messages.

    Raises:
        InputError: it is none of these, or a file that `read_intrinsics` can't read.
    """
    if isinstance(intrinsics, Camera):
        return intrinsics.matrix
    if isinstance(intrinsics, str | Path):
        return read_intrinsics(Path(intrinsics))
    try:
        return _from_content(
            dict(intrinsics) if isinstance(intrinsics, Mapping) else intrinsics, name
        )
    except (ValueError, TypeError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"intrinsics of {name} aren't numbers ({reason}); {_EXPECTED}") from error


def require_size(intrinsics: Intrinsics, height: int, width: int, name: str) -> None:
    """Checks intrinsics that say what size of image they are of.

    Args:
        intrinsics: as `intrinsic_matrix` takes them: a camera, or a file or dict with `width` and
            `height`; all else is of any size.
        height: of the image.
        width: of the image.
        name: of the image, for messages.

    Raises:
        InputError: they are of another size.
    """
    size = _size(intrinsics)
    if size is None or size == (width, height):
        return
    turned = size == (height, width)
    raise InputError(
        f"{name} has {width} x {height} pixels, but its intrinsics are of {size[0]} x {size[1]}; "
        + ("is the depth transposed?" if turned else "give the intrinsics of this image size")
    )


def _size(intrinsics: Intrinsics) -> tuple[int, int] | None:
    """Width and height of the image that intrinsics are of, where they say it."""
    if isinstance(intrinsics, Camera):
        return intrinsics.width, intrinsics.height
    if isinstance(intrinsics, str | Path):
        path = Path(intrinsics)
        content = _structured(path) if path.suffix.lower() in _STRUCTURED else None
    else:
        content = intrinsics
    if not isinstance(content, Mapping):
        return None
    width, height = content.get("width"), content.get("height")
    return (width, height) if isinstance(width, int) and isinstance(height, int) else None


def _structured(path: Path) -> Any:
    text = path.read_text(encoding="utf-8-sig")
    return json.loads(text) if path.suffix.lower() == ".json" else yaml.safe_load(text)


def camera_from_matrix(K: ArrayLike, height: int, width: int, name: str) -> Camera:  # noqa: N803
    """A camera at the origin with intrinsics K (3, 3) for an image of this size.

    Raises:
        InputError: K has another shape or can't belong to an image of this size.
    """
    values = np.asarray(K)
    if values.dtype.kind not in "uif":
        raise InputError(f"intrinsics of {name} are of {values.dtype}; {_EXPECTED} in pixels")
    matrix = values.astype(np.float64)
    if matrix.shape != (3, 3):
        raise InputError(f"intrinsics of {name} have shape {matrix.shape}; {_EXPECTED}")
    (fx, _, cx), (_, fy, cy) = matrix[:2]
    if not (np.isfinite(matrix).all() and fx > 0 and fy > 0):
        raise InputError(
            f"intrinsics of {name} have fx = {fx:g}, fy = {fy:g}; {_EXPECTED} in pixels"
        )
    if not (0 <= cx < width and 0 <= cy < height):
        raise InputError(
            f"intrinsics of {name} have their centre at ({cx:g}, {cy:g}), outside the image of "
            f"{width} x {height} pixels; give the intrinsics of this image size"
        )
    if not np.allclose(matrix[2], (0, 0, 1), atol=1e-6):
        transposed = np.allclose(matrix[:2, 2], 0, atol=1e-6)
        raise InputError(
            f"intrinsics of {name} have {matrix[2].tolist()} as their last row, not 0 0 1; "
            + ("K looks transposed: give fx 0 cx, 0 fy cy, 0 0 1" if transposed else _EXPECTED)
        )
    return Camera(width, height, float(fx), float(fy), float(cx), float(cy))


def _from_content(content: Any, path: Path | str) -> NDArray[np.float64]:
    if isinstance(content, dict):
        if {"fx", "fy", "cx", "cy"} <= content.keys():
            return _from_numbers([content[key] for key in ("fx", "fy", "cx", "cy")], path)
        key = next((key for key in _KEYS if key in content), None)
        if key is None:
            raise InputError(f"no intrinsics in {path} (keys: {', '.join(content)}); {_EXPECTED}")
        return _from_content(content[key], path)
    return _from_numbers(content, path)


def _from_numbers(content: Any, path: Path | str) -> NDArray[np.float64]:
    if np.iscomplexobj(content):
        raise InputError(f"intrinsics of {path} are complex numbers; {_EXPECTED}")
    numbers = np.asarray(content, dtype=np.float64)
    if numbers.size == 4:
        fx, fy, cx, cy = numbers.ravel()
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    if numbers.size == 9:
        return numbers.reshape(3, 3)
    raise InputError(f"intrinsics of {path} hold {numbers.size} numbers; {_EXPECTED}")
