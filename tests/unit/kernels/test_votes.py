"""Vote kernels against brute force in plain numpy, and the CUDA grid against the CPU loop."""

import numpy as np
import pytest
import torch

from scenefw.kernels.votes import count_traversals, shift_to_modes

SIDE = 6


def count(starts, directions, blocks, subdivisions):
    counts = torch.zeros((int(blocks.max()) + 1) * subdivisions**3, dtype=torch.int32)
    count_traversals(len(starts), starts, directions, blocks, subdivisions, counts)
    return counts


def open_blocks():
    return torch.arange(SIDE**3, dtype=torch.int32).reshape(SIDE, SIDE, SIDE)


def random_rays(number, seed=0):
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(number, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    starts = rng.integers(0, SIDE, (number, 3))
    return torch.tensor(starts, dtype=torch.int32), torch.tensor(directions, dtype=torch.float32)


def crossed_cells(start, direction, subdivisions):
    """Cells in which tiny steps along the ray land, as (x, y, z) of the fine grid."""
    steps = np.arange(0, SIDE * 2, 2e-4)[:, None]
    points = start + 0.5 + steps * direction
    inside = ((points >= 0) & (points < SIDE)).all(axis=1)
    return set(map(tuple, np.floor(points[inside] * subdivisions).astype(int).tolist()))


def fine_cells(counts, subdivisions):
    """Counts as a dense grid of fine cells."""
    s = subdivisions
    grid = counts.numpy().reshape(SIDE, SIDE, SIDE, s, s, s)
    return grid.transpose(0, 3, 1, 4, 2, 5).reshape((SIDE * s,) * 3)


@pytest.mark.parametrize("subdivisions", [1, 3, 10])
def test_cells_of_a_ray_are_those_that_tiny_steps_land_in(subdivisions):
    starts, directions = random_rays(8)
    for start, direction in zip(starts, directions, strict=True):
        counts = count(start[None].clone(), direction[None].clone(), open_blocks(), subdivisions)
        grid = fine_cells(counts, subdivisions)
        assert grid.max() == 1  # never twice in one cell
        found = set(map(tuple, np.argwhere(grid).tolist()))
        expected = crossed_cells(start.double().numpy(), direction.double().numpy(), subdivisions)
        # Rounding may take another way past a corner, which tiny steps may leap over.
        assert len(expected - found) <= 1
        assert len(found - expected) <= 2


def test_rays_add_up():
    starts, directions = random_rays(50)
    total = sum(
        count(starts[i : i + 1].clone(), directions[i : i + 1].clone(), open_blocks(), 4)
        for i in range(50)
    )
    assert torch.equal(count(starts, directions, open_blocks(), 4), total)


def test_axis_rays_go_straight_to_the_wall():
    blocks = open_blocks()
    starts = torch.tensor([[1, 2, 3]], dtype=torch.int32)
    for axis in range(3):
        for sign in (-1, 1):
            direction = torch.zeros(1, 3)
            direction[0, axis] = sign
            cells = int(count(starts, direction, blocks, 10).sum())
            way = SIDE - int(starts[0, axis]) - 0.5 if sign > 0 else int(starts[0, axis]) + 0.5
            assert cells == round(way * 10)


def test_rays_end_at_walls_and_pass_uncounted_voxels():
    blocks = torch.full((SIDE, SIDE, SIDE), -1, dtype=torch.int32)
    blocks[4, 2, 2], blocks[5, 2, 2] = 0, 1
    starts, direction = torch.tensor([[1, 2, 2]], dtype=torch.int32), torch.tensor([[1.0, 0, 0]])
    assert count(starts, direction, blocks, 5).reshape(2, -1).sum(dim=1).tolist() == [5, 5]
    blocks[3, 2, 2] = -2
    assert int(count(starts, direction, blocks, 5).sum()) == 0


def test_mean_shift_finds_the_means_of_separate_clusters():
    rng = np.random.default_rng(0)
    centres = np.array([[0, 0, 0], [20, 0, 0], [0, 20, 5.0]])
    clusters = [c + 0.3 * rng.normal(size=(200, 3)) for c in centres]
    weights = rng.uniform(0.5, 2, (3, 200))
    points = torch.tensor(np.concatenate(clusters), dtype=torch.float32)
    seeds = torch.tensor(centres + [[1, 0.5, -1]] * 3, dtype=torch.float32)
    densities = torch.zeros(3)
    masses = torch.tensor(weights.ravel(), dtype=torch.float32)
    shift_to_modes(3, points, masses, 5.0, 200, seeds, densities)
    # A kernel much wider than a cluster weighs its points alike.
    means = [(c * w[:, None]).sum(0) / w.sum() for c, w in zip(clusters, weights, strict=True)]
    np.testing.assert_allclose(seeds.numpy(), means, atol=0.02)
    np.testing.assert_allclose(densities.numpy(), weights.sum(axis=1), rtol=0.02)


def results():
    starts, directions = random_rays(6)
    counts = count(starts, directions, open_blocks(), 2)
    points = torch.tensor(np.random.default_rng(1).normal(size=(10, 3)), dtype=torch.float32)
    modes, densities = points[:3].clone(), torch.zeros(3)
    shift_to_modes(3, points, torch.ones(10), 0.8, 20, modes, densities)
    return {"counts": counts.numpy(), "modes": modes.numpy(), "densities": densities.numpy()}


def test_the_cuda_grid_equals_the_loop(simulated):
    ours = results()
    np.testing.assert_array_equal(simulated["counts"], ours["counts"])
    np.testing.assert_allclose(simulated["modes"], ours["modes"], atol=1e-3)
    np.testing.assert_allclose(simulated["densities"], ours["densities"], rtol=1e-3)
