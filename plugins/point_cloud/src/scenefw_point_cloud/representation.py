"""Point clouds of depth images."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.geometry import transform_points
from scenefw.core.types import Frame
from scenefw_point_cloud.cloud import PointCloud, palette

Floats = NDArray[np.float64]


class PointClouds:
    """Makes point clouds with outward normals and instance labels.

    Args:
        stride: takes every n-th pixel of a depth image along both axes.
        edge: neighbours whose depths differ by more than this share of the depth lie on two
            surfaces; normals are taken on one side of such an edge.
    """

    def __init__(self, stride: int = 1, edge: float = 0.02) -> None:
        if stride < 1 or edge <= 0:
            raise ConfigError(f"stride={stride}, edge={edge}: give a stride >= 1 and an edge > 0")
        self.stride = stride
        self.edge = edge

    def of_frame(self, frame: Frame) -> PointCloud:
        """Every measured pixel as a point in world coordinates; lone pixels are left out.

        Raises:
            InputError: no pixel holds a depth.
        """
        depth = np.asarray(frame.depth, dtype=np.float64)
        depth = np.where(np.isfinite(depth) & (depth > 0), depth, 0.0)
        if not depth.any():
            raise InputError(f"depth image {frame.name} holds no depth > 0; give metres")
        points = _back_projected(depth, frame)
        normals = np.cross(self._slope(points, 0), self._slope(points, 1))
        length = np.linalg.norm(normals, axis=-1)
        mask = (depth > 0) & (length > 0)
        mask &= _stride_mask(self.stride, depth.shape)
        signs = np.sign(np.sum(normals * points, axis=-1))  # a seen surface faces the camera
        normals = normals[mask] * (-signs / np.where(length > 0, length, 1))[mask][:, None]
        labels = np.zeros(depth.shape, np.int32) if frame.labels is None else frame.labels
        labels = labels[mask].astype(np.int32)
        colours = palette(labels) if frame.colour is None else frame.colour[mask]
        pose = frame.camera.T_world_camera
        turned = normals @ pose[:3, :3].T
        return PointCloud(transform_points(pose, points[mask]), turned, labels, colours)

    def _slope(self, points: Floats, axis: int) -> Floats:
        """Tangent (H, W, 3) along an image axis: from both sides, or the one without an edge."""
        step = np.diff(points, axis=axis)
        nearer_depth = np.minimum(*_pair(points[..., 2], axis))
        smooth = (nearer_depth > 0) & (np.abs(step[..., 2]) <= self.edge * nearer_depth)
        step = np.where(smooth[..., None], step, 0.0)
        pad = [(0, 0)] * 3
        pad[axis] = (1, 1)
        padded = np.pad(step, pad)
        before, after = _pair(padded, axis)
        return before + after


def _pair(values: Floats, axis: int) -> tuple[Floats, Floats]:
    """All but the last, and all but the first along an axis: neighbours."""
    count = values.shape[axis]
    return (
        np.take(values, np.arange(count - 1), axis=axis),
        np.take(values, np.arange(1, count), axis=axis),
    )


def _back_projected(depth: Floats, frame: Frame) -> Floats:
    camera = frame.camera
    v, u = np.indices(depth.shape)
    x, y = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy
    return np.stack([x * depth, y * depth, depth], axis=-1)


def _stride_mask(stride: int, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    mask = np.zeros(shape, dtype=bool)
    mask[::stride, ::stride] = True
    return mask
