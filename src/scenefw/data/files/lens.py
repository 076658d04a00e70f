"""Distortion of lenses: what OpenCV, ROS and depth cameras write, and images freed of it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from scenefw.core.errors import InputError
from scenefw.core.types import Float64

FISHEYE, BROWN = "fisheye", "Brown-Conrady"
_FISHEYE_WORDS = ("fisheye", "equidistant", "kannala")
_BROWN_WORDS = (
    "plumb", "rational", "brown", "radtan", "radial", "opencv", "pinhole", "perspective",
)  # fmt: skip
_OTHER_MODEL = re.compile(r"\b(fov|omni\w*|mei|ds|sphere|e?ucm|f ?theta|division|inverse)\b")
_MAX_BROWN = 8  # k1 k2 p1 p2 k3 k4 k5 k6; thin prisms and tilted sensors come after these
_MIN_REMAINING = 0.6
"""Share of the measurements that an image keeps: Azure's and Kinect's lenses leave above 0.9, a
fisheye of 150 degrees 0.5."""
_PROFILE_STEPS = 2000  # radii at which the model is checked


@dataclass(frozen=True)
class Lens:
    """How a lens distorts, in OpenCV's models.

    Args:
        model: `BROWN` (with up to three radial coefficients more below the line: rational) or
            `FISHEYE`.
        coefficients: k1 k2 p1 p2 k3 k4 k5 k6, or k1 k2 k3 k4 of a fisheye.
    """

    model: str
    coefficients: tuple[float, ...]

    def distorted(self, x: Float64, y: Float64) -> tuple[Float64, Float64]:
        """Where rays x, y (at z = 1) of a pinhole camera arrive, at z = 1."""
        if self.model == FISHEYE:
            radius = np.hypot(x, y)
            angle = np.arctan(radius)
            powers = [k * angle ** (2 * n) for n, k in enumerate(self.coefficients, start=1)]
            ratio = angle * (1 + sum(powers)) / np.maximum(radius, 1e-12)
            return x * ratio, y * ratio
        k1, k2, p1, p2, k3, k4, k5, k6 = self.coefficients
        r2 = x * x + y * y
        radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
        return (
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        )

    def max_radius(self, limit: float) -> float:
        """Radius at z = 1 up to which the model grows with the radius, at most `limit`."""
        radii = np.linspace(0, limit, _PROFILE_STEPS)
        with np.errstate(divide="ignore", invalid="ignore"):
            profile, _ = self.distorted(radii, np.zeros_like(radii))
        falling = np.flatnonzero(~(np.diff(profile) > 0))
        return float(radii[falling[0]]) if falling.size else limit


def is_fisheye(model: Any) -> bool:
    """Whether a model's name is one of those of fisheye lenses."""
    return any(word in str(model or "").lower() for word in _FISHEYE_WORDS)


def lens_name(model: Any, names: Iterable[Any]) -> Any:
    """What decides of the lens: the model of its distortion, unless a name of the camera does.

    Args:
        model: of the distortion, None where it isn't said.
        names: of the camera; that of a product tells no lens.
    """
    for name in names:
        if is_fisheye(name) or _is_other(name):
            return name
    return model


def _is_other(model: Any) -> bool:
    """Whether a name is that of a model that isn't read."""
    words = re.sub("[-_]", " ", str(model or "").lower())
    return _OTHER_MODEL.search(words) is not None


def lens_of(model: Any, coefficients: Any, name: str) -> Lens | None:
    """The lens that a file tells; None if it doesn't distort.

    Args:
        model: what the file calls it; None: OpenCV's.
        coefficients: in OpenCV's order.
        name: of the file or image, for messages.

    Raises:
        InputError: another model, or coefficients that are no numbers.
    """
    try:
        values = np.asarray(coefficients, np.float64).ravel()
    except (TypeError, ValueError) as error:
        raise InputError(f"the distortion of {name} holds no numbers ({error}); fix it") from error
    if not np.isfinite(values).all():
        raise InputError(f"the distortion of {name} holds {values.tolist()}; give finite numbers")
    if not values.any():
        return None
    words = str(model or "").lower()
    if is_fisheye(model):
        return Lens(FISHEYE, tuple(np.resize(np.append(values, np.zeros(4)), 4).tolist()))
    is_brown = not words or any(word in words for word in _BROWN_WORDS)
    if not is_brown or _is_other(model) or values[_MAX_BROWN:].any():
        raise InputError(
            f"the lens of {name} is of an unknown model ({model or values.size}); undistort "
            "the images with your camera's software, and give coefficients of 0"
        )
    padded = np.append(values, np.zeros(_MAX_BROWN))[:_MAX_BROWN]
    return Lens(BROWN, tuple(padded.tolist()))


def undistorted(
    lens: Lens, matrix: Float64, images: Sequence[NDArray[Any] | None], name: str
) -> list[Any]:
    """Images of a pinhole camera with the same intrinsics.

    Pixels take the nearest value, as between both sides of an edge of depth there is nothing;
    three channels of colour are interpolated. 0 where the lens saw nothing.

    Args:
        lens: of all images.
        matrix: (3, 3) intrinsics.
        images: (H, W), the first one depth, or (H, W, 3) uint8; all of one size. None stays None.
        name: of the image, for messages.

    Raises:
        InputError: the lens is so strong that too little of the depth would remain.
    """
    depth = np.asarray(images[0])
    height, width = depth.shape
    v, u = np.mgrid[:height, :width].astype(np.float64)
    x, y = (u - matrix[0, 2]) / matrix[0, 0], (v - matrix[1, 2]) / matrix[1, 1]
    radius = np.hypot(x, y)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        distorted_x, distorted_y = lens.distorted(x, y)
    columns = distorted_x * matrix[0, 0] + matrix[0, 2]
    rows = distorted_y * matrix[1, 1] + matrix[1, 2]
    inside = (radius <= lens.max_radius(float(radius.max()))) & (
        (columns > -0.5) & (columns < width - 0.5) & (rows > -0.5) & (rows < height - 0.5)
    )
    rows, columns = np.where(inside, rows, 0), np.where(inside, columns, 0)
    nearest = np.rint(rows).astype(np.intp), np.rint(columns).astype(np.intp)
    _require_remaining(depth, nearest, inside, name)
    return [
        None if image is None else _sampled(image, rows, columns, nearest, inside)
        for image in images
    ]


def _sampled(
    image: NDArray[Any],
    rows: Float64,
    columns: Float64,
    nearest: tuple[NDArray[np.intp], NDArray[np.intp]],
    inside: NDArray[np.bool_],
) -> NDArray[Any]:
    if image.ndim == 2:
        return np.where(inside, image[nearest], image.dtype.type(0))
    channels = [
        map_coordinates(image[..., n], (rows, columns), order=1, mode="nearest") * inside
        for n in range(image.shape[2])
    ]
    return np.stack(channels, axis=-1)


def _require_remaining(
    depth: NDArray[Any],
    nearest: tuple[NDArray[np.intp], NDArray[np.intp]],
    inside: NDArray[np.bool_],
    name: str,
) -> None:
    """Raises an InputError if too little of the measurements reaches the new image."""
    used = np.zeros(depth.shape, bool)
    used[nearest[0][inside], nearest[1][inside]] = True
    measured = depth > 0
    # where the middle is stretched, all is used; where it is shrunk, what lies between counts too
    reached = _between(used)
    share = float((reached & measured).sum() / max(int(measured.sum()), 1))
    if share < _MIN_REMAINING:
        raise InputError(
            f"the lens of {name} is too strong for an image of a pinhole camera: {share:.0%} of "
            "its measurements would remain; undistort depth with your camera's software to a "
            "narrower view, and give its intrinsics"
        )


def _between(used: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Pixels (H, W) between used ones of their row."""
    return np.logical_or.accumulate(used, axis=1) & np.flip(
        np.logical_or.accumulate(np.flip(used, axis=1), axis=1), axis=1
    )
