"""Rays through unions of convex solids, beside one part at a time."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from scenefw.core.batches import CameraBatch
from scenefw_things.shells.solid_rays import PartPlanes, shells

SIZE, FOCAL = 12, 14.0


def camera(count=1):
    lens = torch.tensor([[FOCAL, FOCAL, (SIZE - 1) / 2, (SIZE - 1) / 2]])
    return CameraBatch(SIZE, SIZE, lens.expand(count, -1), torch.eye(4).expand(count, -1, -1))


def parts_of(*solids):
    """Planes and balls of solids, each a list of corners."""
    planes, ends, balls, ranges = [], [0], [], []
    for solid in solids:
        ranges.append([len(balls), len(balls) + len(solid)])
        for corners in solid:
            sides = ConvexHull(corners).equations
            planes.append(sides)
            ends.append(ends[-1] + len(sides))
            balls.append(
                [*corners.mean(0), np.linalg.norm(corners - corners.mean(0), axis=1).max()]
            )
    values = (
        np.int32(ranges),
        np.int32(ends),
        np.float32(balls),
        np.concatenate(planes).astype(np.float32),
    )
    return PartPlanes(*map(torch.from_numpy, values))


def box(low, high):
    return np.stack(np.meshgrid(*zip(low, high, strict=True), indexing="ij"), -1).reshape(-1, 3)


def cast(solids, frames=None, min_gap=0.01):
    frames = torch.eye(4)[:3].expand(len(solids), -1, -1) if frames is None else frames
    return shells(camera(len(solids)), frames, parts_of(*solids), min_gap)


def test_two_walls_before_one_another_have_a_gap():
    wall, other = box((-1, -1, 0.5), (1, 1, 0.6)), box((-1, -1, 0.8), (1, 1, 0.95))
    shell = cast([[other, wall]])
    assert shell.amodal.all()
    assert shell.hollow.all()
    for layer, depth in enumerate((0.5, 0.95, 0.6, 0.8)):
        torch.testing.assert_close(shell.depths[0, layer], torch.full((SIZE, SIZE), depth))


def test_of_several_gaps_the_widest_counts_and_narrow_ones_are_none():
    heights = [(0.5, 0.6), (0.65, 0.7), (0.9, 1.0), (1.005, 1.1)]
    walls = [box((-1, -1, low), (1, 1, high)) for low, high in heights]
    shell = cast([walls])
    assert shell.depths[0, :, 5, 5].tolist() == pytest.approx([0.5, 1.1, 0.7, 0.9], abs=1e-5)
    touching = cast([[walls[2], walls[3], box((-1, -1, 0.8), (1, 1, 0.9))]])
    assert not touching.hollow.any()
    assert touching.depths[0, :, 5, 5].tolist() == pytest.approx([0.8, 1.1, 0, 0], abs=1e-5)


def test_more_walls_than_are_counted_keep_their_ends():
    walls = [box((-1, -1, z), (1, 1, z + 0.01)) for z in np.arange(0.5, 1.5, 0.1)]
    shell = cast([walls[::-1]])
    assert shell.depths[0, :2, 5, 5].tolist() == pytest.approx([0.5, 1.41], abs=1e-5)


def test_a_solid_beside_the_image_is_not_met():
    shell = cast([[box((5, 5, 0.5), (6, 6, 0.6))], [box((-1, -1, -0.6), (1, 1, -0.5))]])
    assert not shell.amodal.any()
    assert not shell.depths.any()


def test_maps_may_scale_and_mirror():
    solid = [box((0.02, -0.05, 0.5), (0.2, 0.1, 0.7))]
    frames = torch.diag(torch.tensor([-0.5, 0.5, 0.5, 1.0]))[:3].expand(1, -1, -1)
    shell, plain = cast([solid], frames), cast([solid])
    torch.testing.assert_close(shell.amodal.flip(-1), plain.amodal)
    torch.testing.assert_close(shell.depths.flip(-1), 2 * plain.depths)


def intervals(corners, rays):
    """Entry and exit (H, W) of rays through a convex solid, entry behind exit where they miss."""
    planes = ConvexHull(corners).equations
    slopes = rays @ planes[:, :3].T
    cuts = -planes[:, 3] / slopes
    near = np.where(slopes < 0, cuts, -np.inf).max(-1)
    return near, np.where(slopes > 0, cuts, np.inf).min(-1)


@given(seed=st.integers(0, 10**6), count=st.integers(1, 4))
def test_ends_and_gaps_agree_with_the_parts_one_by_one(seed, count):
    rng = np.random.default_rng(seed)
    solid = [
        rng.uniform(-0.1, 0.1, (8, 3)) + rng.uniform(-0.15, 0.15, 3) + (0, 0, 0.8)
        for _ in range(count)
    ]
    shell = cast([solid], min_gap=0.01)
    rows, columns = np.indices((SIZE, SIZE))
    middle = (SIZE - 1) / 2
    rays = np.stack([(columns - middle) / FOCAL, (rows - middle) / FOCAL, np.ones_like(rows)], -1)
    near, far = map(np.array, zip(*(intervals(corners, rays) for corners in solid), strict=True))
    met, clear = far > near, (np.abs(far - near) > 1e-4).all(0)
    depths, hollow = shell.depths[0].numpy(), shell.hollow[0].numpy()
    np.testing.assert_array_equal(shell.amodal[0].numpy()[clear], met.any(0)[clear])
    shown = met.any(0) & clear
    entry, leaving = np.where(met, near, np.inf).min(0), np.where(met, far, -np.inf).max(0)
    np.testing.assert_allclose(depths[0][shown], entry[shown], atol=1e-4)
    np.testing.assert_allclose(depths[1][shown], leaving[shown], atol=1e-4)
    for v, u in zip(*np.nonzero(shown), strict=True):
        order = sorted((n, f) for n, f, m in zip(near[:, v, u], far[:, v, u], met[:, v, u],
                                                 strict=True) if m)  # fmt: skip
        ends = np.maximum.accumulate([f for _, f in order])
        gaps = [(n - end, end, n) for end, (n, _) in zip(ends, order[1:], strict=False)]
        widest = max(gaps, default=(0, 0, 0))
        if abs(widest[0] - 0.01) > 1e-4:
            assert hollow[v, u] == (widest[0] > 0.01)
        if hollow[v, u]:
            assert depths[3, v, u] - depths[2, v, u] == pytest.approx(widest[0], abs=1e-4)


def results():
    """A hollow of two walls, in the image's middle alone."""
    walls = [box((-0.2, -0.15, z), (0.15, 0.2, z + 0.05)) for z in (0.6, 0.8)]
    shell = cast([walls, walls[:1]])
    return {name: value.numpy() for name, value in vars(shell).items()}


@pytest.mark.slow
def test_the_grid_of_threads_gives_what_the_loop_gives(simulated):
    for name, expected in results().items():
        assert len(np.unique(expected)) > 1
        differ = np.abs(simulated[name].astype(float) - expected) > 1e-4
        assert differ.mean() <= 0.01
