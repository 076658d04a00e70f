"""What a file says of a camera: intrinsics, size of the image, lens, unit of the depth."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scenefw.core.errors import InputError
from scenefw.core.types import Camera
from scenefw.data.files.lens import Lens, is_fisheye, lens_name, lens_of
from scenefw.data.files.structured import read_structured, read_text

_MATRIX_KEYS = (
    "K", "k", "camera_matrix", "cameraMatrix", "intrinsic_matrix", "intrinsics", "intrinsic",
    "cam_K", "data",
)  # fmt: skip
_FOUR_KEYS = (
    ("fx", "fy", "cx", "cy"),
    ("_fx", "_fy", "_cx", "_cy"),  # the Berkeley perception library
    ("fx", "fy", "ppx", "ppy"),  # librealsense
    ("fl_x", "fl_y", "cx", "cy"),  # nerfstudio
)
_SIZE_KEYS = (
    ("width", "height"),
    ("image_width", "image_height"),
    ("_width", "_height"),
    ("w", "h"),
)
_SIZES_KEYS = ("resolution", "image_size", "imageSize", "img_size", "size")  # of both in a list
_SCALE_KEYS = (
    "depth_scale", "depthScale", "png_depth_scale", "depth_units", "depth_unit", "depth_factor",
    "factor_depth", "DepthMapFactor",
)  # fmt: skip
_UNITS = {
    "m": 1.0, "meter": 1.0, "meters": 1.0, "metre": 1.0, "metres": 1.0, "cm": 0.01, "mm": 0.001,
    "millimeters": 0.001, "millimetres": 0.001,
}  # fmt: skip
_LENS_KEYS = (
    "distortion_coefficients", "distortion_coeffs", "dist_coeffs", "distCoeffs", "distortion",
    "distCoef", "dist_coef", "dist", "coeffs", "D", "d",
)  # fmt: skip
_LENS_MODEL_KEY, _CAMERA_NAME_KEYS = "distortion_model", ("camera_model", "model")
_LENS_WORD = re.compile(r"distort|dist_?coe|radial|tangential", re.IGNORECASE)
_FISHEYE_NUMBERS = ("k1", "k2", "k3", "k4")
_LENS_NUMBERS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")

_SUFFIXES = (".json", ".yaml", ".yml", ".txt", ".intr")
_STEMS = (
    "intrinsics", "camera", "K", "intrinsic", "camera_intrinsics", "camera_intrinsic",
    "camera_info", "cam_K", "depth_intrinsics", "intrinsic/intrinsic_depth",
)  # fmt: skip
_EXPECTED = "give a 3 x 3 matrix K, or fx, fy, cx, cy"

Intrinsics: TypeAlias = ArrayLike | Camera | Mapping[str, Any] | str | Path
"""Whatever holds the intrinsics of an image: see `calibration_of`."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """What is known of a camera.

    Args:
        matrix: (3, 3) intrinsics in pixels.
        size: width and height of the image that they are of; None: not said.
        lens: its distortion; None if there is none.
        depth_scale: the number that a file calls so, whose unit `image_checks.unit_of` finds out.
    """

    matrix: NDArray[Any]
    size: tuple[int, int] | None = None
    lens: Lens | None = None
    depth_scale: float | None = None

    def resized(self, width: int, height: int) -> Calibration:
        """Of the image resampled to another size.

        Raises:
            InputError: that is of another shape.
        """
        if self.size is None or self.size == (width, height):
            return self
        if min(self.size) < 1 or abs(self.size[0] / self.size[1] * height - width) > 1:
            raise InputError(
                f"intrinsics are of {self.size[0]} x {self.size[1]} pixels, depth has {width} x "
                f"{height}, of another shape; are width and height swapped?"
            )
        (fx, _, cx), (_, fy, cy) = self.matrix[:2]
        camera = Camera(*self.size, fx, fy, cx, cy).resized(width, height)
        return replace(self, matrix=camera.matrix, size=(width, height))


def intrinsics_file(folders: Iterable[Path], stems: Iterable[str] = ()) -> Path | None:
    """The first file in some folders that is named as intrinsics are; None if there is none.

    Args:
        folders: in the order in which they are searched.
        stems: names without suffix that come first, such as that of an image.
    """
    for folder in folders:
        names = [stem + suffix for stem in (*stems, *_STEMS) for suffix in _SUFFIXES]
        files = (folder / name for name in names)
        intrinsics = sorted(folder.glob("*.intr")) if folder.is_dir() else []
        for file in (*files, *intrinsics[:1]):
            if file.is_file():
                return file
    return None


def read_calibration(path: Path) -> Calibration:
    """Intrinsics and what else a .json, .yaml, .yml, .intr or .txt file says of a camera.

    JSON and YAML hold `fx, fy, cx, cy` (also as librealsense, nerfstudio and the Berkeley
    perception library name them), or a matrix as `K`, `camera_matrix`, `intrinsic_matrix` ...,
    nested, or flat row by row, or column by column as Open3D and Record3D write it; 4 x 4 as in
    ScanNet; as `data` in ROS and OpenCV. With them: size of the image, distortion, `depth_scale`.
    Text holds nine or sixteen numbers, or four in the order fx fy cx cy.

    Raises:
        InputError: the file is missing, of another format, or holds something else.
    """
    suffix = path.suffix.lower()
    if not path.is_file():
        raise InputError(f"no intrinsics file {path}; {_EXPECTED} in a .json, .yaml or .txt file")
    if suffix not in _SUFFIXES:
        raise InputError(
            f"unknown intrinsics format '{suffix}' of {path}; use .json, .yaml or .txt"
        )
    if suffix == ".txt":
        content: Any = read_text(path).replace(",", " ").split()
    else:
        try:
            content = read_structured(path)
        except InputError as error:
            reason = (
                str(error).removeprefix(f"cannot read {path}: ").removesuffix("; is it damaged?")
            )
            raise InputError(f"cannot read intrinsics {path}: {reason}; {_EXPECTED}") from error
    try:
        return _calibration(content, str(path))
    except (ValueError, TypeError, OverflowError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"cannot read intrinsics {path}: {reason}; {_EXPECTED}") from error


def calibration_of(intrinsics: Intrinsics, name: str) -> Calibration:
    """What whatever holds intrinsics says of a camera.

    Args:
        intrinsics: K itself, a camera, `{"fx": ..., "fy": ..., "cx": ..., "cy": ...}` or a matrix
            by one of the names that files use, the four numbers fx fy cx cy, or the path of a file.
        name: of the image, for messages.

    Raises:
        InputError: it is none of these, or a file that `read_calibration` can't read.
    """
    if isinstance(intrinsics, Camera):
        return Calibration(intrinsics.matrix, (intrinsics.width, intrinsics.height))
    if isinstance(intrinsics, str | Path):
        return read_calibration(Path(intrinsics))
    content = dict(intrinsics) if isinstance(intrinsics, Mapping) else intrinsics
    try:
        return _calibration(content, name)
    except (ValueError, TypeError, OverflowError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"intrinsics of {name} aren't numbers ({reason}); {_EXPECTED}") from error


def require_size(calibration: Calibration, height: int, width: int, name: str) -> None:
    """Raises an InputError if intrinsics say that they are of an image of another size."""
    size = calibration.size
    if size is None or size == (width, height):
        return
    turned = size == (height, width)
    same_shape = size[0] * height == size[1] * width
    scale = width / size[0]
    fix = (
        "is the depth transposed?"
        if turned
        else f"give the intrinsics of this image size, or, if depth was resized, multiply them by "
        f"{scale:.4g}"
        if same_shape
        else "give the intrinsics of this image size; are they of the colour camera?"
    )
    raise InputError(
        f"{name} has {width} x {height} pixels, but its intrinsics are of {size[0]} x {size[1]}; "
        + fix
    )


def camera_from_matrix(K: ArrayLike, height: int, width: int, name: str) -> Camera:  # noqa: N803
    """A camera at the origin with intrinsics K (3, 3) for an image of this size.

    Raises:
        InputError: K has another shape, a skew, or can't belong to an image of this size.
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
    skew = matrix[0, 1], matrix[1, 0]
    if not np.allclose(skew, 0, atol=1e-6 * max(fx, fy)):
        raise InputError(
            f"intrinsics of {name} have a skew (K[0,1] = {skew[0]:g}, K[1,0] = {skew[1]:g}), which "
            "scenefw's cameras have not; rectify the image, or give 0 there if it is noise"
        )
    return Camera(width, height, float(fx), float(fy), float(cx), float(cy))


def _calibration(content: Any, name: str) -> Calibration:
    if not isinstance(content, dict):
        return Calibration(_matrix(content, name))
    for keys in _FOUR_KEYS:
        if set(keys) <= content.keys():
            return _with_details(_matrix([content[key] for key in keys], name), content, name)
    key = next((key for key in _MATRIX_KEYS if key in content), None)
    if key is None:
        raise InputError(
            f"no intrinsics in {name} (keys: {', '.join(map(str, content))}); {_EXPECTED}"
        )
    if isinstance(content[key], dict):
        inner = _calibration(content[key], name)
        outer = _with_details(inner.matrix, content, name)
        return Calibration(
            inner.matrix,
            outer.size or inner.size,
            outer.lens or inner.lens,
            outer.depth_scale or inner.depth_scale,
        )
    return _with_details(_matrix(content[key], name), content, name)


def _with_details(
    matrix: NDArray[np.float64], content: Mapping[str, Any], name: str
) -> Calibration:
    """Size, lens and unit beside a matrix."""
    scales = (_scale(content[key], key, name) for key in _SCALE_KEYS if key in content)
    scale = next((scale for scale in scales if scale is not None), None)
    size, lens, region = _size(content), _lens(content, name), content.get("roi")
    if isinstance(region, Mapping) and all(_size(region) or (0,)):
        # ROS: K is of the image before it was cropped
        matrix = matrix.copy()
        matrix[:2, 2] -= [_number(region, key) or 0.0 for key in ("x_offset", "y_offset")]
        size = _size(region)
    return Calibration(matrix, size, lens, scale)


def _size(content: Mapping[str, Any]) -> tuple[int, int] | None:
    """Width and height, where they are said."""
    numbers = [(_number(content, width), _number(content, height)) for width, height in _SIZE_KEYS]
    for value in (content.get(key) for key in _SIZES_KEYS):
        if isinstance(value, Mapping):
            numbers.append((_number(value, "width"), _number(value, "height")))
        elif isinstance(value, Sequence) and not isinstance(value, str) and len(value) == 2:
            numbers.append((_number({"": value[0]}, ""), _number({"": value[1]}, "")))
    return next(((int(w), int(h)) for w, h in numbers if w is not None and h is not None), None)


def _scale(value: Any, key: str, name: str) -> float | None:
    """The number that a file calls so, of a unit in words, too; None says nothing."""
    if value is None:
        return None
    text = str(value).strip().lower()
    try:
        return _UNITS[text] if text in _UNITS else float(value)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{key} of {name} is {value!r}; expected metres per unit, such as 0.001"
        ) from error


def _number(content: Mapping[str, Any], key: str) -> float | None:
    value = content.get(key)
    is_number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    return float(value) if is_number and value is not None else None


def _lens(content: Mapping[str, Any], name: str) -> Lens | None:
    """The lens beside intrinsics.

    Raises:
        InputError: it is told in a way that isn't read.
    """
    names = [content.get(key) for key in _CAMERA_NAME_KEYS]
    model = lens_name(content.get(_LENS_MODEL_KEY), names)
    key = next((key for key in _LENS_KEYS if content.get(key) is not None), None)
    if key is None:
        _require_no_other_lens(content, name)
        return _named_lens(model, content, name)
    values = content[key]
    if isinstance(values, Mapping) and "data" not in values:
        lens = _named_lens(values.get("model", model), values, name)
        if lens is None:
            _require_no_other_lens({f"{key}: {inner}": v for inner, v in values.items()}, name)
        return lens
    values = values["data"] if isinstance(values, Mapping) else values
    if isinstance(values, str):
        values = values.replace(",", " ").split()
    return lens_of(model, values, name)


def _named_lens(model: Any, content: Mapping[str, Any], name: str) -> Lens | None:
    """The lens of coefficients k1, p1 ... by their names; None without any."""
    names = _FISHEYE_NUMBERS if is_fisheye(model) else _LENS_NUMBERS
    numbers = [content.get(number) for number in names]
    if all(number is None for number in numbers):
        return None
    return lens_of(model, [0.0 if number is None else number for number in numbers], name)


def _require_no_other_lens(content: Mapping[str, Any], name: str) -> None:
    """Raises an InputError if a key that isn't read tells that the lens distorts."""
    for key, value in content.items():
        if key == _LENS_MODEL_KEY or not _LENS_WORD.search(str(key)):
            continue
        try:
            is_nothing = not np.any(np.asarray(value, np.float64))
        except (TypeError, ValueError):
            is_nothing = not value or str(value).lower() in ("none", "null")
        if not is_nothing:
            raise InputError(
                f"{key} of {name} isn't read; give the lens as distortion_coefficients: k1 k2 p1 "
                "p2 k3 ... in OpenCV's order, or undistort the images"
            )


def _matrix(content: Any, name: str) -> NDArray[np.float64]:
    """K (3, 3) of four, nine or sixteen numbers."""
    if np.iscomplexobj(content):
        raise InputError(f"intrinsics of {name} are complex numbers; {_EXPECTED}")
    numbers = np.asarray(content, dtype=np.float64)
    if numbers.size == 4:
        fx, fy, cx, cy = numbers.ravel()
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    if numbers.size == 9:
        matrix = numbers.reshape(3, 3)
        by_columns = numbers.ndim == 1 and not matrix[:2, 2].any() and matrix[2, :2].all()
        return matrix.T if by_columns else matrix
    if numbers.size == 16:
        whole = numbers.reshape(4, 4)
        if np.allclose(whole[3], (0, 0, 0, 1)) and np.allclose(whole[:3, 3], 0):
            return whole[:3, :3]
        raise InputError(f"the 4 x 4 matrix of {name} is a pose, no intrinsics; {_EXPECTED}")
    raise InputError(f"intrinsics of {name} hold {numbers.size} numbers; {_EXPECTED}")
