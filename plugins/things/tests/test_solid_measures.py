"""Scores of one object, beside a ball and boxes whose figures are known."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from scenefw.core.geometry import look_at
from scenefw.core.types import Camera
from scenefw.shapes.hulls import sphere_points
from scenefw.shapes.object_shell import ObjectShell
from scenefw_things.shells.solid_measures import (
    Solid,
    chamfer,
    hull_solid,
    overlap,
    shell_solid,
)

RADIUS, CENTRE = 0.05, np.array([0.1, -0.05, 0.05])
SIZE = 96


def rng():
    return np.random.default_rng(0)


def ball():
    return Solid(lambda x: np.linalg.norm(x - CENTRE, axis=1) < RADIUS,
                 CENTRE + RADIUS * sphere_points(4000))  # fmt: skip


def shell(gap=0.0):
    """The ball, with a gap about its middle, as a camera that looks at it would give it."""
    eye = np.array([0.5, 0.3, 0.6])
    pose = look_at(eye, CENTRE)
    camera = Camera(SIZE, SIZE, 400.0, 400.0, (SIZE - 1) / 2, (SIZE - 1) / 2, pose)
    rows, columns = np.indices((SIZE, SIZE))
    middle = (SIZE - 1) / 2
    rays = np.stack([(columns - middle) / 400, (rows - middle) / 400, np.ones_like(rows)], -1)
    local = pose[:3, :3].T @ (CENTRE - eye)
    a, b = (rays**2).sum(-1), rays @ local
    root = b**2 - a * (local @ local - RADIUS**2)
    half = np.sqrt(np.maximum(root, 0)) / a
    entry, leaving = b / a - half, b / a + half
    hole = np.minimum(gap / 2, half)
    depths = np.stack([entry, leaving, b / a - hole, b / a + hole])
    return ObjectShell(camera, root > 0, (root > 0) & (gap > 0), depths.astype(np.float32))


def test_the_shell_of_a_ball_is_the_ball():
    solid = shell_solid(shell(), rng())
    assert overlap(solid, ball()) > 0.95
    assert np.abs(np.linalg.norm(solid.points - CENTRE, axis=1) - RADIUS).mean() < 0.0015
    assert chamfer(solid.points, ball().points) < 0.0025


def test_a_gap_is_outside():
    solid = shell_solid(shell(gap=0.04), rng())
    assert not solid.inside(CENTRE[None])[0]
    assert shell_solid(shell(), rng()).inside(CENTRE[None])[0]
    assert overlap(solid, ball()) < 0.6


def test_places_outside_the_image_and_behind_the_camera_are_outside():
    view = shell()
    behind = view.camera.T_world_camera[:3, 3] * 2 - CENTRE
    assert (view.signed_distance(np.stack([behind, CENTRE + 1.0])) > 0).all()


def test_a_shell_without_depth_is_no_solid():
    flat = shell()
    assert shell_solid(replace(flat, depths=flat.depths[[1, 1, 1, 1]]), rng()) is None


def test_hulls_reach_the_floor_with_footprints_alone():
    low, high = np.array([0.0, 0.0, 0.06]), np.array([0.06, 0.12, 0.12])
    corners = np.stack(np.meshgrid(*zip(low, high, strict=True), indexing="ij"), -1).reshape(-1, 3)
    hull, standing = (hull_solid(corners, rng(), footprint=f) for f in (False, True))
    below = np.array([[0.03, 0.03, 0.03]])
    assert not hull.inside(below)[0]
    assert standing.inside(below)[0]
    assert overlap(hull, standing) == pytest.approx(0.5)
    assert overlap(hull, hull) == 1.0
    assert hull_solid(corners[:3], rng(), footprint=False) is None


def test_chamfer_is_the_mean_of_both_directions():
    first = torch.rand(50, 3, generator=torch.Generator().manual_seed(0)).double()
    second = torch.rand(70, 3, generator=torch.Generator().manual_seed(1)).double()
    distances = torch.cdist(first, second)
    expected = (distances.amin(0).mean() + distances.amin(1).mean()) / 2
    assert chamfer(first.numpy(), second.numpy()) == pytest.approx(float(expected))
