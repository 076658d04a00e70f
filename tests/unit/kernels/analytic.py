"""Scenes of spheres and boxes on the floor with exact distances and rays, in numpy and float64."""

from dataclasses import dataclass

import numpy as np
import torch

from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, GridSpec


@dataclass(frozen=True)
class Sphere:
    centre: tuple[float, float, float]
    radius: float

    def distance(self, points):
        return np.linalg.norm(points - np.array(self.centre), axis=-1) - self.radius

    def normal(self, points):
        outward = points - np.array(self.centre)
        return outward / np.linalg.norm(outward, axis=-1, keepdims=True)

    def hit(self, origin, rays):
        """Multiple of each ray at which it enters; inf where it misses."""
        from_centre = origin - np.array(self.centre)
        a, b = (rays * rays).sum(-1), rays @ from_centre
        root = b * b - a * (from_centre @ from_centre - self.radius**2)
        near = (-b - np.sqrt(np.maximum(root, 0))) / a
        return np.where((root > 0) & (near > 0), near, np.inf)


@dataclass(frozen=True)
class Box:
    centre: tuple[float, float, float]
    half: tuple[float, float, float]

    def distance(self, points):
        q = np.abs(points - np.array(self.centre)) - np.array(self.half)
        return np.linalg.norm(np.maximum(q, 0), axis=-1) + np.minimum(q.max(-1), 0)

    def hit(self, origin, rays):
        with np.errstate(divide="ignore"):
            first = (np.array(self.centre) - self.half - origin) / rays
            second = (np.array(self.centre) + self.half - origin) / rays
        near, far = np.minimum(first, second).max(-1), np.maximum(first, second).min(-1)
        return np.where((near < far) & (near > 0), near, np.inf)


BALL = Sphere((0.05, 0.0, 0.16), 0.16)
SCENE = (Sphere((0.12, 0.0, 0.12), 0.12), Box((-0.12, 0.06, 0.1), (0.08, 0.1, 0.1)))


def distances(shapes, grid):
    return np.min([shape.distance(grid.centres()) for shape in shapes], axis=0)


def tsdf(shapes, grid):
    """(1, 1, X, Y, Z) float32."""
    cut = np.clip(distances(shapes, grid), -grid.truncation, grid.truncation)
    return torch.from_numpy(cut).float()[None, None]


def instances(shapes, grid):
    """(1, X, Y, Z) int32: number of the shape that a voxel centre is in, from 1."""
    each = np.stack([shape.distance(grid.centres()) for shape in shapes])
    inside = np.where(each.min(0) < 0, each.argmin(0) + 1, 0)
    return torch.from_numpy(inside.astype(np.int32))[None]


def camera(eye=(0.8, 0.3, 0.6), target=(0.0, 0.0, 0.1), width=320, height=240):
    return Camera(T_world_camera=look_at(eye, target)).resized(width, height)


def pixel_rays(view):
    """World directions (H, W, 3) that advance by 1 along the optical axis, and the origin."""
    v, u = np.mgrid[: view.height, : view.width]
    local = np.stack([(u - view.cx) / view.fx, (v - view.cy) / view.fy, np.ones(u.shape)], -1)
    return local @ view.T_world_camera[:3, :3].T, view.T_world_camera[:3, 3]


def hits(shapes, origin, rays, *, floor=True):
    """Multiple of each ray at which the scene is hit; inf where it is not."""
    first = np.min([shape.hit(origin, rays) for shape in shapes], axis=0)
    if not floor:
        return first
    with np.errstate(divide="ignore"):
        ground = -origin[2] / rays[..., 2]
    return np.minimum(first, np.where(ground > 0, ground, np.inf))


def depth(shapes, view, *, floor=True):
    """(H, W) float32 z-depth, 0 where nothing is hit."""
    rays, origin = pixel_rays(view)
    z = hits(shapes, origin, rays, floor=floor)
    return torch.from_numpy(np.where(np.isfinite(z), z, 0)).float()


def along_rays(shapes, view, grid: GridSpec):
    """Signed distance (X, Y, Z) along each voxel's own ray to the surface that the camera sees."""
    origin = view.T_world_camera[:3, 3]
    rays = grid.centres() - origin
    return (hits(shapes, origin, rays) - 1) * np.linalg.norm(rays, axis=-1)


def in_image(view, grid: GridSpec):
    """Whether each voxel centre (X, Y, Z) projects into the image."""
    pose = view.T_world_camera
    local = (grid.centres() - pose[:3, 3]) @ pose[:3, :3]
    with np.errstate(divide="ignore", invalid="ignore"):
        u = view.fx * local[..., 0] / local[..., 2] + view.cx
        v = view.fy * local[..., 1] / local[..., 2] + view.cy
    inside = (u > -0.5) & (u < view.width - 0.5) & (v > -0.5) & (v < view.height - 0.5)
    return inside & (local[..., 2] > 0)
