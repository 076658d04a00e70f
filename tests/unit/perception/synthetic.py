"""Depth images of boxes on a table, ray-cast analytically, and of meshes, by rays."""

from dataclasses import dataclass

import numpy as np
import torch

from scenefw.core.geometry import look_at, rigid
from scenefw.core.types import Camera, Frame
from scenefw.kernels.meshes import Tree


@dataclass(frozen=True)
class Box:
    """An axis-aligned box on or above the table z = 0."""

    lower: tuple
    upper: tuple


STACK = (
    Box((-0.10, -0.08, 0.0), (0.10, 0.08, 0.12)),
    Box((-0.05, -0.05, 0.12), (0.05, 0.06, 0.20)),
)


def camera_at(eye=(0.1, -0.8, 0.6), target=(0.0, 0.0, 0.05), roll=0.0, size=(320, 240)):
    """A camera looking at a target, turned about its axis by `roll` radians."""
    c, s = np.cos(roll), np.sin(roll)
    turn = rigid([[c, -s, 0], [s, c, 0], [0, 0, 1]], (0, 0, 0))
    width, height = size
    focal = 1.1 * width
    return Camera(
        width, height, focal, focal, (width - 1) / 2, (height - 1) / 2, look_at(eye, target) @ turn
    )


def cast_at(mesh, camera):
    """Depth (H, W) of a mesh before a posed camera, and where it is seen (H, W)."""
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    local = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)])
    ahead = local.reshape(3, -1).T @ camera.T_world_camera[:3, :3].T
    eyes = np.broadcast_to(camera.T_world_camera[:3, 3], ahead.shape)
    rays = np.concatenate([eyes, ahead], axis=1).astype(np.float32)
    depth, hit, _ = Tree(mesh.vertices[mesh.faces].astype(np.float32)).cast(torch.from_numpy(rays))
    return depth.numpy().reshape(u.shape), (hit.numpy() >= 0).reshape(u.shape)


def frame_of(camera, boxes=STACK, table=None, noise=0.0, name="synthetic", room=None):
    """The frame a camera at a known pose sees; its own camera is unposed.

    `table` is a box whose top is z = 0 (None: an endless plane); `room` a lower floor's height.
    """
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    rays = np.stack(
        [(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], axis=-1
    )
    pose = camera.T_world_camera
    directions, eye = rays @ pose[:3, :3].T, pose[:3, 3]
    solids = [*boxes, *([table] if table else [])]
    depths = [_hit_box(eye, directions, box) for box in solids]
    if table is None:
        depths.append(_hit_plane(eye, directions, 0.0))
    if room is not None:
        depths.append(_hit_plane(eye, directions, room))
    depths = np.stack(depths)
    nearest = depths.argmin(axis=0)
    depth = depths.min(axis=0)
    depth = np.where(np.isfinite(depth), depth, 0)
    depth += np.where(depth > 0, np.random.default_rng(0).normal(0, noise, depth.shape), 0)
    labels = np.where((nearest < len(boxes)) & (depth > 0), nearest + 1, 0)
    unposed = camera.moved(np.eye(4))
    return Frame(depth.astype(np.float32), unposed, None, labels.astype(np.int32), name)


def _hit_plane(eye, directions, height):
    with np.errstate(divide="ignore"):
        t = (height - eye[2]) / directions[..., 2]
    return np.where((t > 0) & np.isfinite(t), t, np.inf)


def _hit_box(eye, directions, box):
    with np.errstate(divide="ignore", invalid="ignore"):
        a = (np.array(box.lower) - eye) / directions
        b = (np.array(box.upper) - eye) / directions
    enter, leave = np.minimum(a, b).max(axis=-1), np.maximum(a, b).min(axis=-1)
    return np.where((enter < leave) & (enter > 0), enter, np.inf)
