"""A bad frame anywhere in a sequence is outvoted; references: plain least squares and the truth."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from tests.unit.mapping import tables

from scenefw.core.height_maps import HeightGrid
from scenefw.core.types import Frame
from scenefw.data.files.height_maps import load_map, save_map
from scenefw.mapping.height_fusion import HeightFusion

FINE = HeightGrid(129, 0.256, (-0.128, -0.128), 3)
GRIDS = pytest.mark.parametrize("grid", [tables.SMALL, FINE], ids=["33", "129"])


def around(count):
    """Boxes seen from a circle; every camera sees nearly the same."""
    return [
        tables.boxes(tables.camera(*spot, 0.22, 12, k, width=160, rows=120))
        for k in range(count)
        for spot in [(0.01 * np.cos(k), 0.01 * np.sin(k))]
    ]


def spoilt(frame, scale=0.8):
    return Frame(frame.depth * np.float32(scale), frame.camera)


def begun(frames, grid, **options):
    running = HeightFusion(grid, **options).begin()
    for frame in frames:
        running.add(frame)
    return running


def fused(frames, grid, **options):
    return begun(frames, grid, **options).height_map()


def errors(found, grid):
    """Distances to the truth (m) at vertices that are surely known."""
    truth, clear = tables.box_heights(grid)
    sure = clear & (found.confidence > 1)
    assert sure.mean() > 0.3
    return np.abs(found.heights - truth)[sure]


@GRIDS
@pytest.mark.parametrize("scale", [0.8, 1.2])
@pytest.mark.parametrize("place", [0, 20])
def test_a_bad_frame_anywhere_is_outvoted(grid, scale, place):
    first, *good = around(21)
    found = fused([*good[:place], spoilt(first, scale), *good[place:]], grid)
    assert errors(fused(good, grid, outlier=None), grid).mean() < 1e-4
    assert errors(found, grid).mean() < 1e-3


@GRIDS
def test_few_good_frames_outvote_a_bad_first_one(grid):
    first, *good = around(5)
    found = errors(fused([spoilt(first), *good], grid), grid)
    plain = errors(fused([spoilt(first), *good], grid, outlier=None), grid)
    assert found.mean() < plain.mean() * 0.85


@GRIDS
def test_frames_bad_in_different_ways_are_outvoted(grid):
    frames = around(21)
    bad = [spoilt(frames[0]), spoilt(frames[1], 1.2), spoilt(frames[2], 0.65)]
    assert errors(fused([*bad, *frames[3:]], grid), grid).mean() < 2.5e-3


@GRIDS
def test_without_a_bad_frame_heights_are_those_of_least_squares(grid):
    frames = around(12)
    found, plain = fused(frames, grid), fused(frames, grid, outlier=None)
    assert errors(found, grid).mean() < 1e-4
    _, clear = tables.box_heights(grid)
    sure = clear & (plain.confidence > 1)
    assert np.abs(found.heights - plain.heights)[sure].mean() < 5e-5


def test_no_single_frame_has_votes():
    first, good = around(2)
    running = begun([good, spoilt(first)], tables.SMALL)
    named, votes = running.state()["rivals"].T
    assert (named > 0.02).mean() > 0.5
    assert (votes == 0).all()


def coupled(sums, grid):
    """J'J of the finest level as a matrix, from the records of its vertices."""
    n, v = grid.vertices, grid.vertices**2
    records = sums[n + 1 : n + 1 + v]
    rows, columns, values = [np.arange(v)], [np.arange(v)], [records[:, 0]]
    for entry, step in ((1, 1), (2, n), (3, n + 1)):
        held = np.flatnonzero(records[:, entry])
        rows += [held, held + step]
        columns += [held + step, held]
        values += [records[held, entry]] * 2
    data = np.concatenate(values).astype(np.float64)
    return coo_array((data, (np.concatenate(rows), np.concatenate(columns)))), records[:, 5]


def test_equations_stay_sound_where_a_rival_takes_over():
    """Rows of J'J sum to the weights, so that a level is exact; no eigenvalue is negative."""
    first, *good = around(7)
    half = np.where(np.arange(160) < 80, first.depth * np.float32(0.8), first.depth)
    sums = begun([Frame(half, first.camera), *good], tables.SMALL).state()["sums"]
    before = begun([first, *good], tables.SMALL).state()["sums"]
    assert (np.abs(sums[:, 5] - before[:, 5]) > 1).sum() > 50  # it did take over
    matrix, weights = coupled(sums, tables.SMALL)
    np.testing.assert_allclose(matrix.sum(axis=1), weights, atol=1e-3)
    assert np.linalg.eigvalsh(matrix.toarray()).min() > -1e-4


@GRIDS
@pytest.mark.parametrize("stop", [1, 2, 3, 5])
def test_a_saved_map_goes_on_exactly_amid_a_vote(tmp_path, grid, stop):
    first, *good = around(8)
    frames, fusion = [spoilt(first), *good], HeightFusion(grid)
    whole = begun(frames[:stop], grid)
    path = save_map(tmp_path / "map.npz", whole.height_map(), {"heights": whole.state()})
    resumed = fusion.begin(state=load_map(path, grid).states["heights"])
    for frame in frames[stop:]:
        whole.add(frame)
        resumed.add(frame)
    for name, values in whole.state().items():
        np.testing.assert_array_equal(resumed.state()[name], values)
    for name in ("heights", "confidence", "variance"):
        np.testing.assert_array_equal(
            getattr(resumed.height_map(), name), getattr(whole.height_map(), name)
        )


@GRIDS
def test_a_state_of_an_earlier_version_goes_on(grid):
    first, *good = around(12)
    early = begun([spoilt(first), *good[:1]], grid)
    state = early.state()
    del state["rivals"]
    resumed = HeightFusion(grid).begin(state=state)
    for name in ("heights", "confidence", "variance"):
        np.testing.assert_array_equal(
            getattr(resumed.height_map(), name), getattr(early.height_map(), name)
        )
    for frame in good[1:]:
        resumed.add(frame)
    assert errors(resumed.height_map(), grid).mean() < 2e-3
