"""Images of places as networks see them, beside loops in numpy."""

import numpy as np
import pytest
import torch

from scenefw.kernels.place_images import CELL, CHANNELS, cell_points, place_image


def images(height, width, seed=0):
    """Places of a slanted table with some holes, and what stands on it."""
    random = np.random.default_rng(seed)
    places = np.stack(
        np.broadcast_arrays(
            0.01 * np.arange(width), -0.008 * np.arange(height)[:, None], 0.1
        ), axis=-1,
    ) + random.normal(0, 0.003, (2, height, width, 3))  # fmt: skip
    places[random.random((2, height, width)) < 0.1] = np.nan
    above = (random.random((2, height, width)) < 0.3) & ~np.isnan(places[..., 0])
    return torch.from_numpy(places).float(), torch.from_numpy(above)


@pytest.mark.parametrize("size", [(8, 12), (32, 16)])
def test_steps_are_differences_of_neighbours(size):
    places, above = images(*size)
    made = place_image(places, above)
    assert made.shape == (2, CHANNELS, *size)
    assert torch.isfinite(made).all()
    assert torch.equal(made[:, -2] > 0, above)
    assert torch.equal(made[:, -1] == 0, places[..., 0].isnan())
    values = places.numpy()
    for row, column in ((0, 0), (size[0] - 1, 3), (4, size[1] - 1), (5, 6)):
        right = values[:, row, min(column + 1, size[1] - 1)] - values[:, row, max(column - 1, 0)]
        down = values[:, min(row + 1, size[0] - 1), column] - values[:, max(row - 1, 0), column]
        here = values[:, row, column] / [0.2, 0.2, 0.1]
        wide = np.concatenate([right / 0.02, down / 0.02, here], axis=-1)
        bounded = np.nan_to_num(wide / (1 + np.abs(wide) / 2))
        np.testing.assert_allclose(made[:, :-2, row, column], bounded, atol=1e-5)


def test_a_floor_that_goes_on_stays_bounded():
    places, above = images(8, 8)
    assert place_image(1e4 * places, above).abs().max() < 2.001


@pytest.mark.parametrize("size", [(8, 12), (32, 16)])
def test_a_cell_has_the_place_of_its_pixel_above_the_floor_nearest_to_its_middle(size):
    places, above = images(*size, seed=1)
    points, seen = cell_points(places, above)
    columns = size[1] // CELL
    for cell in range(points.shape[1]):
        row, column = cell // columns * CELL, cell % columns * CELL
        for view in range(2):
            inside = [
                ((r - 1.5) ** 2 + (c - 1.5) ** 2, places[view, row + r, column + c])
                for r in range(CELL) for c in range(CELL) if above[view, row + r, column + c]
            ]  # fmt: skip
            assert bool(seen[view, cell]) == bool(inside)
            if inside:
                least = min(away for away, _ in inside)
                nearest = [place for away, place in inside if away == least]
                assert any(torch.equal(points[view, cell], place) for place in nearest)
            else:
                assert not points[view, cell].any()
