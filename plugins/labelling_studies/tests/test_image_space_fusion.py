from dataclasses import replace

import numpy as np
import pytest
from tests.unit.mapping import tables
from tests.unit.mapping.test_semantic_fusion import certain, distributions

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.geometry import inverse, transform_points
from scenefw.core.height_maps import HeightMap
from scenefw.core.types import Camera, Frame
from scenefw_labelling_studies.image_space_fusion import ImageSpaceFusion


def height_map(heights, grid=tables.SMALL):
    heights = heights.astype(np.float32)
    nothing = np.zeros(grid.shape, np.float32)
    return HeightMap(grid, heights, np.zeros((*grid.shape, 3), np.uint8), nothing, nothing)


def reference(frames, labels, heights, floor, tolerance, power):
    """Vertex by vertex in numpy."""
    grid, classes = heights.grid, len(labels[0])
    logs = np.zeros((classes, *grid.shape))
    points = np.concatenate([grid.positions(), heights.heights[..., None]], axis=-1)
    for frame, probabilities in zip(frames, labels, strict=True):
        view = frame.camera
        local = transform_points(inverse(view.T_world_camera), points)
        for row, column in np.ndindex(grid.shape):
            x, y, z = local[row, column]
            if not z > 0:
                continue
            u, v = view.fx * x / z + view.cx, view.fy * y / z + view.cy
            if not (0 <= u <= view.width - 1 and 0 <= v <= view.height - 1):
                continue
            depth = frame.depth[int(v + 0.5), int(u + 0.5)]
            if depth <= 0 or abs(depth - z) > tolerance:
                continue
            i, j = min(int(v), view.height - 2), min(int(u), view.width - 2)
            t, s = v - i, u - j
            four = probabilities[:, i : i + 2, j : j + 2]
            mixed = (four * np.outer([1 - t, t], [1 - s, s])).sum(axis=(1, 2))
            slant = abs(view.T_world_camera[2, 3] - points[row, column, 2])
            slant /= np.linalg.norm(local[row, column])
            likelihood = floor + (1 - classes * floor) * mixed
            logs[:, row, column] += slant**power * np.log(likelihood)
    exponentials = np.exp(logs - logs.max(axis=0))
    return exponentials / exponentials.sum(axis=0)


@pytest.mark.parametrize("power", [0.0, 2.0])
def test_probabilities_are_those_of_a_slow_loop(power):
    frames = [tables.boxes(view) for view in tables.views(3)]
    labels = [distributions(frame, 3, seed) for seed, frame in enumerate(frames)]
    heights = tables.box_heights(tables.SMALL)[0]
    heights[:4] = np.nan
    known = height_map(heights)
    running = ImageSpaceFusion(0.01, 0.02, power).begin(tables.SMALL, 3)
    for frame, probabilities in zip(frames, labels, strict=True):
        running.add(probabilities, frame, known)
    expected = reference(frames, labels, known, 0.01, 0.02, power)
    found = running.probabilities()
    np.testing.assert_allclose(found.sum(axis=0), 1, atol=1e-5)
    assert (np.abs(found - expected).max(axis=0) > 1e-3).mean() < 0.01  # roundings at the limits
    assert (np.abs(expected - 1 / 3).max(axis=0) > 0.1).mean() > 0.5
    np.testing.assert_allclose(found[:, :4], 1 / 3, atol=1e-6)


def test_hidden_vertices_hear_nothing():
    view = tables.camera(-0.15, 0.0, 0.15, 45)
    wall = [tables.analytic.Box((0.0, 0.0, 0.03), (0.005, 0.2, 0.03))]
    frame = tables.boxes(view, wall)
    running = ImageSpaceFusion().begin(tables.SMALL, 4)
    running.add(certain(frame, 1), frame, height_map(tables.box_heights(tables.SMALL, wall)[0]))
    along = running.probabilities()[1, 16]  # along x, the wall in the middle
    assert (along[4:14] > 0.9).all()
    assert (along[19:26] == 0.25).all()  # in the wall's shadow


def test_a_camera_that_sees_the_horizon_reaches_all_of_the_map():
    frame = tables.plane(tables.camera(-0.2, 0.0, 0.1, 75))
    running = ImageSpaceFusion().begin(tables.SMALL, 4)
    running.add(certain(frame, 1), frame, height_map(np.zeros(tables.SMALL.shape)))
    assert (running.probabilities()[1] > 0.9).mean() > 0.3


def test_a_camera_elsewhere_says_nothing():
    frame = tables.plane(tables.camera(5.0, 0.0, 0.3))
    running = ImageSpaceFusion().begin(tables.SMALL, 4)
    running.add(certain(frame, 1), frame, height_map(np.zeros(tables.SMALL.shape)))
    running.add(certain(frame, 1), frame, height_map(np.full(tables.SMALL.shape, np.nan)))
    assert (running.probabilities() == 0.25).all()


def test_later_evidence_recovers_from_a_wrong_frame():
    frame = tables.plane(tables.camera(0, 0, 0.2))
    table = height_map(np.zeros(tables.SMALL.shape))
    running = ImageSpaceFusion().begin(tables.SMALL, 4)
    for label, times in ((3, 1), (1, 2)):
        for _ in range(times):
            running.add(certain(frame, label), frame, table)
    assert running.probabilities()[1, 16, 16] > 0.99


def test_it_goes_on_from_a_state_or_a_map():
    frame = tables.plane(tables.camera(0, 0, 0.2))
    table, fusion = height_map(np.zeros(tables.SMALL.shape)), ImageSpaceFusion()
    running = fusion.begin(tables.SMALL, 3)
    running.add(distributions(frame, 3), frame, table)
    before = running.probabilities()
    again = fusion.begin(tables.SMALL, 3, state=running.state())
    np.testing.assert_array_equal(again.probabilities(), before)
    np.testing.assert_allclose(
        fusion.begin(tables.SMALL, 3, before).probabilities(), before, atol=1e-5
    )


def test_mistakes_are_named():
    frame = tables.plane(tables.camera())
    running = ImageSpaceFusion().begin(tables.SMALL, 3)
    table = height_map(np.zeros(tables.SMALL.shape))
    with pytest.raises(InputError, match="needs a height map"):
        running.add(distributions(frame, 3), frame)
    with pytest.raises(InputError, match="needs a height map"):
        running.add(distributions(frame, 3), frame, replace(table, grid=tables.LEVELS))
    with pytest.raises(InputError, match="have shape"):
        running.add(distributions(frame, 4), frame, table)
    with pytest.raises(ConfigError, match="tolerance"):
        ImageSpaceFusion(tolerance=0)


@pytest.mark.parametrize("size", [(1, 1), (1, 2), (2, 1)])
def test_an_image_of_one_pixel_says_what_that_pixel_says(size):
    """There is no neighbour to mix it with; what follows in memory is another class."""
    grid = tables.SMALL
    known = height_map(np.zeros(grid.shape))
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[:3, 3] = grid.lower[0], grid.lower[1] + grid.extent, 0.5
    camera = Camera(*size, 50.0, 50.0, 0.0, 0.0, pose)  # straight down at the first vertex
    width, height = size
    frame = Frame(np.full((height, width), 0.5, np.float32), camera)
    given = np.array([0.1, 0.7, 0.2], np.float32)
    labels = np.full((3, height, width), 1 / 3, np.float32)
    labels[:, 0, 0] = given
    running = ImageSpaceFusion(0.01, 0.02).begin(grid, 3)
    running.add(labels, frame, known)
    expected = 0.01 + 0.97 * given
    found = running.probabilities()[:, 0, 0]
    np.testing.assert_allclose(found, expected / expected.sum(), atol=1e-5)


def test_probabilities_a_little_below_zero_count_as_zero():
    """As resampling leaves them; their logarithm would be a vote beyond all others."""
    frame, known = tables.boxes(tables.views(1)[0]), height_map(tables.box_heights(tables.SMALL)[0])
    found = []
    for least in (0.0, -0.015):
        labels = np.zeros((3, *frame.depth.shape), np.float32)
        labels[1], labels[2] = 1 - least, least
        running = ImageSpaceFusion(0.001, 0.02).begin(tables.SMALL, 3)
        for _ in range(3):
            running.add(labels, frame, known)
        found.append(running.state()["logits"])
    np.testing.assert_allclose(found[1], found[0], atol=0.1)


@pytest.mark.parametrize("kind", ["previous", "state"])
def test_what_it_goes_on_from_must_be_finite(kind):
    broken = np.full((3, *tables.SMALL.shape), np.nan, np.float32)
    given = {
        "previous": {"previous": broken},
        "state": {"state": {"logits": broken.reshape(3, -1).T}},
    }[kind]
    with pytest.raises(InputError, match="not all finite; fuse it again"):
        ImageSpaceFusion().begin(tables.SMALL, 3, **given)
