"""Solids of rays that are known, beside a ball and slabs whose volumes are."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from skimage.measure import marching_cubes

from scenefw.core.geometry import look_at
from scenefw.core.types import Camera
from scenefw.shapes.object_shell import Foot, ObjectShell

CENTRE = np.array([0.1, -0.05, 0.08])
DOWN = np.diag([1.0, -1.0, -1.0, 1.0])


def lens(size, pose):
    return Camera(size, size, 4.0 * size, 4.0 * size, (size - 1) / 2, (size - 1) / 2, pose)


def rays(camera):
    rows, columns = np.indices((camera.height, camera.width))
    return np.stack([(columns - camera.cx) / camera.fx, (rows - camera.cy) / camera.fy,
                     np.ones(rows.shape)], -1)  # fmt: skip


def ball(size=96, radius=0.05, eye=(0.5, 0.3, 0.6), centre=CENTRE):
    pose = look_at(np.asarray(eye), centre)
    camera = lens(size, pose)
    directions, local = rays(camera), pose[:3, :3].T @ (centre - eye)
    a, b = (directions**2).sum(-1), directions @ local
    root = b**2 - a * (local @ local - radius**2)
    half = np.sqrt(np.maximum(root, 0)) / a
    depths = np.stack([b / a - half, b / a + half, b / a, b / a])
    depths[:, root <= 0] = np.nan  # nobody may use what lies beside an object
    return ObjectShell(camera, root > 0, np.zeros_like(root, bool), depths)


def slabs(gap, size=64, width=32, height=0.5):
    """A block of `width` pixels a side, 0.1 m deep, with a gap in the middle of its depth."""
    pose = DOWN.copy()
    pose[2, 3] = height
    edge = (size - width) // 2
    amodal = np.zeros((size, size), bool)
    amodal[edge : edge + width, edge : edge + width] = True
    depths = np.array([0.3, 0.4, 0.35 - gap / 2, 0.35 + gap / 2])
    depths = np.broadcast_to(depths[:, None, None], (4, size, size))
    return ObjectShell(lens(size, pose), amodal, amodal & (gap > 0), depths)


def solid(mesh):
    body = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert body.is_watertight
    assert body.volume > 0
    return body


@pytest.mark.parametrize("size", [48, 96])
def test_a_ball_has_its_volume_and_place(size):
    body = solid(ball(size).mesh(0.0025))
    assert body.volume == pytest.approx(4 / 3 * np.pi * 0.05**3, rel=0.04)
    np.testing.assert_allclose(body.center_mass, CENTRE, atol=0.0015)


@pytest.mark.parametrize("size", [48, 96])
def test_bumps_of_noise_are_smooth_and_the_volume_stays(size):
    shell = ball(size)
    noise = np.random.default_rng(0).normal(0, 0.002, shell.depths.shape)
    voxel = 0.0025
    rough = replace(shell, depths=shell.depths + noise)
    body = solid(rough.mesh(voxel))
    assert body.volume == pytest.approx(4 / 3 * np.pi * 0.05**3, rel=0.05)
    outward = (body.triangles_center - CENTRE) / 0.05
    field = rough.signed_distance(CENTRE + np.moveaxis(np.indices([61] * 3) - 30, 0, -1) * voxel)
    corners, faces, _, _ = marching_cubes(field, 0.0)
    bumpy = trimesh.Trimesh(corners, faces, process=False)
    bumpy_outward = (bumpy.triangles_center - 30) * voxel / 0.05
    cosines = [np.abs((surface.face_normals * directions).sum(axis=1))
               for surface, directions in ((body, outward), (bumpy, bumpy_outward))]  # fmt: skip
    tilt, bumpy_tilt = (np.median(np.arccos(np.minimum(cosine, 1))) for cosine in cosines)
    assert tilt < 0.8 * bumpy_tilt, (tilt, bumpy_tilt)


@given(st.floats(0.02, 0.07), st.integers(0, 1000))
def test_places_are_inside_where_they_are_inside_the_ball(radius, seed):
    shell = ball(radius=radius)
    places = CENTRE + np.random.default_rng(seed).uniform(-0.1, 0.1, (500, 3))
    height = np.linalg.norm(places - CENTRE, axis=1) - radius
    clear = np.abs(height) > 2 * shell.pixel
    np.testing.assert_array_equal(shell.signed_distance(places)[clear] < 0, height[clear] < 0)


def frustum(near, far, width=32, size=64):
    """Volume between two depths within `width` pixels a side."""
    a, b = (depth * width / (4 * size) for depth in (near, far))
    return (a**2 + a * b + b**2) / 3 * (far - near)


@pytest.mark.parametrize("gap", [0.0, 0.04])
def test_a_gap_holds_nothing(gap):
    shell = slabs(gap)
    middle = np.array([[0.0, 0.0, 0.15]])
    assert (shell.signed_distance(middle) > 0).item() == (gap > 0)
    front, back = (frustum(near, near + 0.05 - gap / 2) for near in (0.3, 0.35 + gap / 2))
    expected = back if gap else front + back  # the larger piece
    assert solid(shell.mesh(0.001)).volume == pytest.approx(expected, rel=0.06)


def test_nothing_lies_below_the_floor():
    shell = slabs(0.0, height=0.35)  # the lower half of the block would
    body = solid(shell.mesh(0.002))
    assert body.bounds[0, 2] == pytest.approx(0, abs=0.001)
    assert body.bounds[1, 2] == pytest.approx(0.05, abs=0.002)


def test_what_is_cut_by_the_image_ends_there():
    shell = slabs(0.0, width=64)
    right = (63.5 - shell.camera.cx) / shell.camera.fx * 0.35
    places = np.array([[right - 0.003, 0, 0.15], [right + 0.003, 0, 0.15]])
    np.testing.assert_array_equal(shell.signed_distance(places) < 0, [True, False])


def test_without_rays_there_is_no_mesh():
    nothing = replace(slabs(0.0), amodal=np.zeros((64, 64), bool))
    assert nothing.mesh(0.002) is None


@given(
    support=st.floats(0, 0.1), bottom=st.floats(0.11, 0.2), top=st.floats(0.21, 0.3),
    height=st.floats(-0.1, 0.5),
)  # fmt: skip
def test_a_foot_reaches_its_support_and_all_above_stays(support, bottom, top, height):
    foot = Foot(support, bottom, top)
    heights = np.array([bottom, top, height])
    stretched = foot.stretched(heights)
    np.testing.assert_allclose(stretched[:2], [support, top], atol=1e-9)
    np.testing.assert_allclose(foot.unstretched(stretched), heights, atol=1e-9)
    assert height < top or stretched[2] == height


@pytest.mark.parametrize("size", [48, 96])
def test_a_block_with_a_foot_stands(size):
    """From 10 to 20 cm above the floor; its lower half is stretched down to 2 cm."""
    block = slabs(0.0, size, size // 2)
    standing = replace(block, foot=Foot(0.02, 0.1, 0.15))
    before, after = (solid(shell.mesh(0.0025)) for shell in (block, standing))
    assert after.bounds[0, 2] == pytest.approx(0.02, abs=0.003)
    np.testing.assert_allclose(after.bounds[1], before.bounds[1], atol=1e-3)
    assert after.volume == pytest.approx(before.volume * 1.8, rel=0.12)  # a pyramid's part
