import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenefw.core.height_maps import HeightGrid, HeightMap
from scenefw.perception.observation.levels import higher_level, lower_level

NOISE = 0.004  # m


def height_map(vertices):
    """A table of 1 m, of which vertices at its left end weren't measured."""
    heights = np.random.default_rng(0).normal(0, NOISE, (vertices, vertices)).astype(np.float32)
    heights[:, : vertices // 8] = np.nan
    plain = np.zeros_like(heights)
    grid = HeightGrid(vertices, 1.0, (-0.5, -0.5), 1)
    return HeightMap(grid, heights, np.zeros((*heights.shape, 3), np.uint8), plain, plain)


@pytest.mark.parametrize("vertices", [129, 513])
@given(level=st.floats(0.06, 0.29))
def test_a_second_table_is_told_with_its_height(vertices, level):
    table = height_map(vertices)
    table.heights[: vertices // 3] -= np.float32(level)
    assert lower_level(table.heights) == pytest.approx(level, abs=NOISE)
    table.heights[: vertices // 3] += np.float32(2 * level)
    assert lower_level(table.heights) is None
    assert higher_level(table) == pytest.approx(level, abs=NOISE)


@pytest.mark.parametrize("vertices", [129, 513])
def test_things_and_the_floor_of_the_room_are_no_tables(vertices):
    table, side = height_map(vertices), vertices // 4
    for row in range(0, vertices - side, side + 4):  # books of one height, 25 cm wide
        for column in range(0, vertices - side, side + 4):
            table.heights[row : row + side, column : column + side] += 0.1
    table.heights[-vertices // 4 :] = -0.7
    assert lower_level(table.heights) is None
    assert higher_level(table) is None
