"""The point cloud: frozen data, and its PLY file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import InputError
from scenefw.core.files import replacing

_RECORD = np.dtype(
    [(name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz")]
    + [(name, "u1") for name in ("red", "green", "blue")]
    + [("label", "<i4")]
)
_PLY_TYPES = {"<f4": "float", "|u1": "uchar", "<i4": "int"}


@dataclass(frozen=True)
class PointCloud:
    """N points on surfaces, in world coordinates.

    Args:
        points: (N, 3) float64 metres.
        normals: (N, 3) float64 unit vectors, pointing out of the surface.
        labels: (N,) int32 instance ids, 0 = no object, -1 = unknown.
        colours: (N, 3) uint8.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    labels: NDArray[np.int32]
    colours: NDArray[np.uint8]

    def __post_init__(self) -> None:
        count = len(self.points)
        shapes = {"points": (count, 3), "normals": (count, 3), "labels": (count,)}
        for name, shape in {**shapes, "colours": (count, 3)}.items():
            if getattr(self, name).shape != shape:
                raise InputError(
                    f"{name} of a point cloud have shape {getattr(self, name).shape}; give {shape}"
                )

    def __len__(self) -> int:
        return len(self.points)

    def save(self, target: Path | str) -> None:
        """Writes binary PLY: position, normal, colour and label of every point."""
        rows = np.empty(len(self), dtype=_RECORD)
        columns = [*self.points.T, *self.normals.T, *self.colours.T, self.labels]
        for name, column in zip(_RECORD.names or (), columns, strict=True):
            rows[name] = column
        with replacing(target) as temporary:
            temporary.write_bytes(_header(len(self)).encode("ascii") + rows.tobytes())


def palette(labels: NDArray[np.int32]) -> NDArray[np.uint8]:
    """A colour (N, 3) for every label (N,): grey for none, hues a golden angle apart."""
    hue = (np.maximum(labels, 0) * 0.618034) % 1.0
    channels = [np.abs(((hue + shift) * 6) % 6 - 3) - 1 for shift in (0.0, 2 / 3, 1 / 3)]
    colours = 55 + 200 * np.clip(np.stack(channels, axis=-1), 0, 1)
    colours[labels <= 0] = 150
    return colours.astype(np.uint8)


def _header(count: int) -> str:
    properties = [
        f"property {_PLY_TYPES[_RECORD[name].str]} {name}" for name in _RECORD.names or ()
    ]
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {count}", *properties]
    return "\n".join([*lines, "end_header", ""])
