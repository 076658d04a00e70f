import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import coo_array, diags_array
from scipy.sparse.linalg import spsolve
from tests.unit.mapping import tables

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.height_maps import HeightGrid
from scenefw.core.types import Frame
from scenefw.mapping.height_fusion import HeightFusion


def fuse(frames, grid=tables.SMALL, **options):
    running = HeightFusion(grid, **options).begin()
    for frame in frames:
        running.add(frame)
    return running.height_map()


def equations(frames, grid):
    """J (N, V * V) and z (N,) of eq. 4.1, pixel by pixel."""
    rows, columns, values, z = [], [], [], []
    for point in np.concatenate([tables.points(frame) for frame in frames]):
        found = tables.triangle(grid, point[:2])
        if found is not None:
            columns.extend(found[0])
            values.extend(found[1])
            rows.extend([len(z)] * 3)
            z.append(point[2])
    return coo_array((values, (rows, columns)), (len(z), grid.vertices**2)).tocsr(), np.array(z)


def solved(frames, grid, damping):
    """Heights of the same equations by a direct sparse solver, NaN where nothing was measured."""
    matrix, z = equations(frames, grid)
    weight, sums, diagonal = matrix.sum(axis=0), matrix.T @ z, (matrix * matrix).sum(axis=0)
    seen = np.flatnonzero(weight > 0)
    pull = np.maximum(damping - diagonal, 1e-3 * diagonal)
    normal = (matrix.T @ matrix + diags_array(pull)).tocsc()[seen][:, seen]
    heights = np.full(grid.vertices**2, np.nan)
    heights[seen] = spsolve(normal, (sums + pull * sums / np.maximum(weight, 1e-30))[seen])
    return heights.reshape(grid.shape), weight.reshape(grid.shape)


def noisy(frame, amount, rng):
    depth = frame.depth + rng.normal(0, amount, frame.depth.shape) * (frame.depth > 0)
    return Frame(depth.astype(np.float32), frame.camera)


@pytest.mark.parametrize("damping", [0.05, 1.0])
def test_heights_are_those_of_a_direct_solver(damping):
    rng = np.random.default_rng(0)
    frames = [noisy(tables.boxes(view), 1e-3, rng) for view in tables.views(3)]
    fused = fuse(frames, damping=damping, outlier=None, iterations=2000)
    heights, weight = solved(frames, tables.SMALL, damping)
    sure = weight > 1e-3  # in float32 nothing is known of vertices that pixels barely touch
    assert sure.sum() > 700
    np.testing.assert_allclose(fused.heights[sure], heights[sure], atol=2e-5)
    np.testing.assert_allclose(fused.confidence, weight, atol=1e-3)
    np.testing.assert_array_equal(fused.seen[sure], np.isfinite(heights)[sure])


def test_a_few_sweeps_per_frame_come_close_to_the_direct_solver():
    rng = np.random.default_rng(0)
    frames = [noisy(tables.boxes(view), 1e-3, rng) for view in tables.views(12)]
    heights, weight = solved(frames, tables.SMALL, 1.0)
    fused = fuse(frames, outlier=None)
    assert np.abs(fused.heights - heights)[weight > 1].mean() < 5e-5


def test_a_plane_is_exact():
    frames = [tables.plane(view, 0.2, -0.3, 0.01) for view in tables.views(6)]
    fused = fuse(frames, damping=0.0, iterations=10)
    x, y = np.moveaxis(tables.SMALL.positions(), -1, 0)
    sure = fused.confidence > 1
    assert sure.mean() > 0.5
    error = fused.heights - (0.2 * x - 0.3 * y + 0.01)
    assert np.abs(error[sure]).max() < 3e-5


def test_a_surface_with_folds_along_edges_of_the_mesh_is_exact():
    frames = []
    for view in tables.views(6):
        valley = tables.plane(view, 0.3).depth, tables.plane(view, -0.3).depth  # z = 0.3 |x|
        frames.append(Frame(np.minimum(*valley), view))
    fused = fuse(frames, damping=0.0, iterations=10)
    sure = fused.confidence > 1
    error = fused.heights - 0.3 * np.abs(tables.SMALL.positions()[..., 0])
    assert np.abs(error[sure]).max() < 5e-5


@pytest.mark.parametrize("vertices", [65, 129])
def test_boxes_are_reconstructed_within_a_millimetre_off_their_walls(vertices):
    grid = HeightGrid(vertices, 0.256, (-0.128, -0.128), 3)
    frames = [tables.boxes(view) for view in tables.views(10, width=160, rows=120)]
    fused = fuse(frames, grid)
    heights, clear = tables.box_heights(grid)
    sure = clear & (fused.confidence > 1)
    assert sure.mean() > 0.4
    error = np.abs(fused.heights - heights)[sure]
    assert error.mean() < 2e-4
    assert np.quantile(error, 0.99) < 1e-3


@given(
    st.floats(-0.05, 0.05), st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(0.15, 0.6),
    st.floats(0, 60), st.floats(0, 6.3),
)  # fmt: skip
def test_a_constant_height_is_exact_for_any_camera(z, x, y, above, angle, towards):
    view = tables.camera(x, y, z + above, angle, towards, width=24, rows=18)
    fused = fuse([tables.plane(view, c=z)], tables.LEVELS)
    assert np.abs(fused.heights[fused.seen] - z).max(initial=0) < 2e-6
    assert np.sqrt(fused.variance[fused.seen]).max(initial=0) < 2e-4
    assert fused.seen.any() == any(
        tables.triangle(tables.LEVELS, point[:2]) is not None
        for point in tables.points(tables.plane(view, c=z))
    )


def test_what_no_measurement_touches_stays_unseen():
    frame = tables.plane(tables.camera(0.02, 0.0, 0.06, width=40, rows=30))
    fused = fuse([frame], tables.LEVELS)
    expected = np.zeros(tables.LEVELS.vertices**2, bool)
    for point in tables.points(frame):
        vertices, weights = tables.triangle(tables.LEVELS, point[:2])
        expected[vertices[weights > 1e-4]] = True
    assert 0 < expected.sum() < expected.size / 4
    np.testing.assert_array_equal(fused.confidence.ravel() > 1e-4, expected)
    assert np.isnan(fused.variance[~fused.seen]).all()
    assert (fused.colour[~fused.seen] == 0).all()
    assert (fused.confidence[~fused.seen] == 0).all()


def test_a_far_camera_fills_between_its_pixels_by_a_coarser_level():
    view = tables.camera(
        0, 0, 0.45, 8, 1.0, width=40, rows=30
    )  # pixels every 1.1 cm on 4 mm vertices
    frame = tables.plane(view, 0.1, 0.05, 0.01)
    several, alone = (
        fuse([frame], tables.LEVELS),
        fuse([frame], HeightGrid(65, 0.256, (-0.128,) * 2, 1)),
    )
    inner = np.s_[8:-8, 8:-8]
    assert alone.seen[inner].mean() < 0.7
    assert several.seen[inner].mean() > 0.97
    x, y = np.moveaxis(tables.LEVELS.positions(), -1, 0)
    assert np.nanmax(np.abs(several.heights - (0.1 * x + 0.05 * y + 0.01))[inner]) < 2e-3


def test_a_near_camera_wins_over_a_far_one():
    far = tables.plane(tables.camera(0, 0, 0.8, width=40, rows=30), c=0.02)
    near = [tables.plane(tables.camera(0, 0, 0.2, towards=k), c=0.01) for k in range(6)]
    fused = fuse([far, *near], tables.LEVELS)
    middle = fused.heights[28:37, 28:37]
    assert np.abs(middle - 0.01).max() < 5e-4


def test_the_order_of_frames_does_not_matter():
    frames = [tables.boxes(view) for view in tables.views(8)]
    first, second = fuse(frames, tables.LEVELS), fuse(frames[::-1], tables.LEVELS)
    np.testing.assert_array_equal(first.seen, second.seen)
    _, clear = tables.box_heights(tables.LEVELS)
    sure = clear & (first.confidence > 1)
    difference = np.abs(first.heights - second.heights)[sure]
    assert difference.mean() < 2e-5
    assert np.quantile(difference, 0.99) < 3e-4


def test_outliers_weigh_little():
    frames = [tables.plane(view, c=0.02) for view in tables.views(8)]
    rng, spoiled = np.random.default_rng(0), [frames[0]]
    for frame in frames[1:]:
        wrong = rng.random(frame.depth.shape) < 0.1
        depth = np.where(wrong, frame.depth - 0.1, frame.depth).astype(np.float32)
        spoiled.append(Frame(depth, frame.camera))
    errors = []
    for outlier in (0.005, None):
        fused = fuse(spoiled, outlier=outlier)
        errors.append(np.abs(fused.heights - 0.02)[fused.confidence > 1].mean())
    assert errors[0] < 2e-3
    assert errors[0] < errors[1] / 4


def test_colour_is_the_mean_of_what_was_seen():
    colours = [(200, 100, 0), (100, 100, 50)]
    view = tables.camera(0, 0, 0.2)
    frames = [
        tables.plane(view, colour=np.full((60, 80, 3), colour, np.uint8)) for colour in colours
    ]
    fused = fuse(frames)
    assert (np.abs(fused.colour[fused.seen].astype(int) - (150, 100, 25)) <= 1).all()
    uncoloured = fuse([*frames, tables.plane(view)])
    np.testing.assert_array_equal(uncoloured.colour, fused.colour)


def test_variance_is_that_of_the_measurements():
    rng = np.random.default_rng(0)
    frames = [noisy(tables.plane(view), 2e-3, rng) for view in [tables.camera()] * 30]
    fused = fuse(frames)
    deviation = np.sqrt(np.median(fused.variance[fused.confidence > 5]))
    assert 1.6e-3 < deviation < 2.2e-3


def test_a_state_goes_on_as_if_never_interrupted():
    frames = [tables.boxes(view) for view in tables.views(6)]
    fusion = HeightFusion(tables.LEVELS)
    running = fusion.begin()
    for frame in frames[:3]:
        running.add(frame)
    resumed = fusion.begin(state=running.state())
    for frame in frames[3:]:
        running.add(frame)
        resumed.add(frame)
    first, second = running.height_map(), resumed.height_map()
    np.testing.assert_array_equal(first.heights, second.heights)
    np.testing.assert_array_equal(first.variance, second.variance)


def test_an_earlier_map_alone_goes_on_closely():
    frames = [tables.boxes(view) for view in tables.views(8)]
    fusion = HeightFusion(tables.LEVELS)
    before = fuse(frames[:4], tables.LEVELS)
    again = fusion.begin(before).height_map()
    np.testing.assert_allclose(again.heights, before.heights, atol=1e-6)
    np.testing.assert_allclose(again.confidence, before.confidence, rtol=1e-6)
    resumed = fusion.begin(before)
    for frame in frames[4:]:
        resumed.add(frame)
    whole, later = fuse(frames, tables.LEVELS), resumed.height_map()
    _, clear = tables.box_heights(tables.LEVELS)
    sure = clear & (whole.confidence > 1)
    assert np.abs(later.heights - whole.heights)[sure].mean() < 1e-4


def test_mistakes_are_named():
    running = HeightFusion(tables.SMALL).begin()
    frame = tables.plane(tables.camera())
    with pytest.raises(InputError, match="aligned images"):
        running.add(Frame(frame.depth, frame.camera, np.zeros((3, 4, 3), np.uint8), name="x"))
    with pytest.raises(InputError, match="begin with the grid"):
        HeightFusion(tables.LEVELS).begin(state=running.state())
    with pytest.raises(InputError, match="begin with the grid"):
        HeightFusion(tables.LEVELS).begin(running.height_map())
    with pytest.raises(ConfigError, match="iterations = 0"):
        HeightFusion(iterations=0)
    with pytest.raises(ConfigError, match="a = 0"):
        HeightFusion(tables.SMALL, a=0).begin()


def test_results_do_not_depend_on_the_number_of_threads():
    frames = [tables.boxes(view) for view in tables.views(4)]
    threads, found = numba.get_num_threads(), []
    for count in (1, threads):
        numba.set_num_threads(count)
        found.append(fuse(frames, tables.LEVELS))
    np.testing.assert_array_equal(found[0].heights, found[1].heights)
    np.testing.assert_array_equal(found[0].confidence, found[1].confidence)
