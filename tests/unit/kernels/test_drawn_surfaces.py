"""Kernels of pictures against the same formulas in numpy and scipy, all rays at once."""

import numpy as np
import pytest
import torch
from scipy import ndimage

from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, GridSpec
from scenefw.kernels import drawn_surfaces, soft_light
from scenefw.kernels.compile import float32
from scenefw.report.surfaces import pixel_places, view_of

KEY = (0.48, -0.36, 0.8)
REACH, LIGHT_REACH = 0.5, 0.6


def camera_of(width):
    pose = look_at((0.3, -0.9, 0.6), (0, 0, 0.1))
    return Camera(width, width // 2, 1.1 * width, width, width / 2, width / 4, pose)


def rays_of(camera):
    """Directions (N, 3) of length 1 in depth."""
    v, u = np.mgrid[: camera.height, : camera.width]
    local = [(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)]
    return (np.stack(local, axis=-1) @ camera.T_world_camera[:3, :3].T).reshape(-1, 3)


def seen(camera, seed=0):
    """Depth, unit normals and labels of blobs on the floor; nothing at some pixels."""
    random = np.random.default_rng(seed)
    size = camera.height, camera.width
    ahead = rays_of(camera)
    floor = -camera.T_world_camera[2, 3] / np.minimum(ahead[:, 2], -1e-3)
    noise = [ndimage.gaussian_filter(random.normal(size=size), 3).ravel() for _ in range(5)]
    labels = np.where(noise[0] > 0.03, 1, 0) + np.where(noise[1] > 0.05, 2, 0)
    depth = np.where(labels > 0, floor * (0.9 + noise[2]), floor)
    nothing = noise[3] > 0.1
    labels[nothing], depth[nothing] = 0, 0
    normals = np.stack(noise[2:], axis=-1) + (0, 0, 0.1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals[labels == 0] = (0, 0, 1)
    normals[nothing] = 0
    return depth.astype(np.float32), normals.astype(np.float32), labels.astype(np.int32)


def tensors(*arrays):
    return [torch.from_numpy(np.ascontiguousarray(one)) for one in arrays]


@pytest.mark.parametrize(("width", "resolution"), [(48, 16), (120, 32)])
@pytest.mark.parametrize("pale", [False, True])
def test_colours_are_those_of_the_formulas(width, resolution, pale):
    camera, grid = camera_of(width), GridSpec(resolution)
    depth, normals, labels = seen(camera)
    random = np.random.default_rng(1)
    light = random.uniform(0.4, 1, (9, 9)).astype(np.float32)
    field = random.uniform(0, 0.1, grid.shape).astype(np.float32)
    shown = random.uniform(0, 1, grid.shape).astype(np.float32)
    palette = random.uniform(0, 1, (3, 3)).astype(np.float32)  # label 3 has no colour: grey
    found = torch.empty(len(depth), 3)
    given = tensors(depth, normals, labels)
    drawn_surfaces.colour(
        len(depth), pixel_places(camera), view_of(camera), *given, torch.from_numpy(light),
        np.float32(LIGHT_REACH), *tensors(field.ravel()), resolution,
        float32(grid.voxel_size, *grid.lower), float32(*KEY), *tensors(palette, shown.ravel()),
        pale, np.float32(REACH), found,
    )  # fmt: skip

    points = camera.T_world_camera[:3, 3] + depth[:, None] * rays_of(camera)
    expected = np.ones((len(depth), 3))
    radius = np.hypot(points[:, 0], points[:, 1]) / REACH
    floor = (depth > 0) & (labels == 0) & (radius <= 1)
    x, y = points[floor, :2].T
    places = [(one / LIGHT_REACH + 1) / 2 * 8 for one in (y, x)]
    bright = ndimage.map_coordinates(light, places, order=1, mode="nearest")
    off = np.minimum(*(np.abs((one + 0.05) % 0.1 - 0.05) for one in (x, y)))
    clear = np.abs(off - 0.0011) > 1e-5  # rounding decides just there
    colour = np.array([0.90, 0.90, 0.91]) * (bright * np.where(off < 0.0011, 0.93, 1))[:, None]
    fade = np.clip((radius[floor] - 0.45) / 0.55, 0, 1)[:, None] ** 1.5
    expected[floor] = np.clip(colour, 0, 1) * (1 - fade) + fade

    own = labels > 0
    bright = soft_light.brightness_of(
        torch.from_numpy(field), grid, *tensors(points[own].astype(np.float32), normals[own]), KEY
    ).numpy()[:, None]
    colour = palette[np.where(labels[own] < 3, labels[own], 0)]
    if pale:
        voxels = grid.to_voxels(points[own]).T
        part = ndimage.map_coordinates(shown, voxels, order=1, mode="nearest")
        share = 0.4 + 0.6 * np.clip(2 * part - 0.5, 0, 1)[:, None]
        colour = (0.93, 0.93, 0.94) + (colour - (0.93, 0.93, 0.94)) * share
    expected[own] = np.clip(colour * bright, 0, 1)
    kept = np.ones(len(depth), bool)
    kept[np.flatnonzero(floor)[~clear]] = False
    assert 0.02 < floor.mean() < 0.9
    assert own.mean() > 0.05
    np.testing.assert_allclose(found.numpy()[kept], expected[kept], atol=2e-3)


@pytest.mark.parametrize("width", [48, 120])
def test_pixels_vary_where_neighbours_differ_or_a_line_is(width):
    camera = camera_of(width)
    depth, normals, labels = seen(camera)
    found = torch.empty(len(depth), dtype=torch.bool)
    drawn_surfaces.varied(
        camera.height, view_of(camera), (width, camera.height), *tensors(depth, normals, labels),
        np.float32(REACH), found,
    )  # fmt: skip
    size = camera.height, width
    points = camera.T_world_camera[:3, 3] + depth[:, None] * rays_of(camera)
    depth, labels, normals = depth.reshape(size), labels.reshape(size), normals.reshape(*size, 3)
    expected = np.zeros(size, bool)
    for row in range(size[0]):
        for column in range(width):
            here = row, column
            for there in (
                (row - 1, column),
                (row + 1, column),
                (row, column - 1),
                (row, column + 1),
            ):
                if not (0 <= there[0] < size[0] and 0 <= there[1] < width):
                    continue
                nothing = depth[here] == 0, depth[there] == 0
                turned = not any(nothing) and normals[here] @ normals[there] < 0.95
                jump = abs(depth[here] - depth[there]) > 0.03 and labels[here] > 0
                expected[here] |= labels[here] != labels[there] or nothing[0] != nothing[1]
                expected[here] |= bool(turned or (jump and not any(nothing)))
    off = np.abs((points[:, :2] + 0.05) % 0.1 - 0.05).min(axis=1)
    pixel = depth.ravel() / camera.fx
    slope = np.clip(camera.T_world_camera[2, 3] / np.maximum(depth.ravel(), 1e-6), 0.1, 1)
    line = (off < 0.0011 + pixel / slope) & (labels.ravel() == 0) & (depth.ravel() > 0)
    line &= np.hypot(points[:, 0], points[:, 1]) < REACH
    assert 0.05 < line.mean() < 0.9
    assert (found.numpy() == (expected.ravel() | line)).mean() > 0.999


@pytest.mark.parametrize("share", [0.2, 1.0])
def test_refined_pixels_are_means_with_outlines(share):
    """Against whole images of four rays a pixel, in which pixels of one ray are repeated."""
    camera = camera_of(32)
    height, width = camera.height, camera.width
    random = np.random.default_rng(2)
    depth, _, labels = seen(camera)
    pixels = np.flatnonzero(random.random(len(depth)) < share)
    fine_labels = random.integers(0, 3, (len(pixels), 4)).astype(np.int32)
    fine_depth = random.choice([1.0, 1.02, 1.1], (len(pixels), 4)).astype(np.float32)
    colours = random.random((len(pixels), 4, 3)).astype(np.float32)
    picture = torch.zeros(len(depth), 3)
    numbers = np.full(len(depth), -1, np.int32)
    numbers[pixels] = np.arange(len(pixels))
    drawn_surfaces.blend(
        len(pixels), *tensors(pixels, numbers), width, *tensors(fine_labels.ravel()),
        *tensors(fine_depth.ravel(), colours.reshape(-1, 3), labels, depth), picture,
    )  # fmt: skip

    whole = []
    for coarse, fine in ((labels, fine_labels), (depth, fine_depth)):
        four = np.repeat(coarse[:, None], 4, axis=1)
        four[pixels] = fine
        blocks = four.reshape(height, width, 2, 2).transpose(0, 2, 1, 3)
        whole.append(blocks.reshape(2 * height, 2 * width))
    edge = np.zeros(whole[0].shape, bool)
    for axis in (0, 1):
        change = np.diff(whole[0], axis=axis) != 0
        step = np.abs(np.diff(whole[1], axis=axis)) > 0.03
        step &= np.delete(whole[0], 0, axis) > 0
        edge |= np.pad(change | step, [(0, 1) if a == axis else (0, 0) for a in (0, 1)])
    edge = edge.reshape(height, 2, width, 2).transpose(0, 2, 1, 3).reshape(-1, 4)[pixels]
    expected = (colours * np.where(edge, 0.45, 1)[..., None]).mean(axis=1)
    np.testing.assert_allclose(picture.numpy()[pixels], expected, atol=1e-6)
    assert not picture.numpy()[numbers < 0].any()
