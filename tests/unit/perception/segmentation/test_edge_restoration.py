"""Edges of blurred images, against what rays really meet."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hydra.utils import instantiate
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import binary_dilation, distance_transform_edt
from tests.unit.perception.blurred import seen
from tests.unit.perception.observations import observation_of

from scenefw import config
from scenefw.core.batches import PartialTSDF
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.types import GridSpec
from scenefw.data.files.readers import read_frame
from scenefw.mapping.projective import Projective
from scenefw.perception.observation.observation import Observation
from scenefw.perception.observation.points import world_points
from scenefw.perception.segmentation.colour_edges import ColourEdges
from scenefw.perception.segmentation.edge_restoration import EdgeRestoration, continued
from scenefw.perception.segmentation.ramp_width import ramp_width
from scenefw_single_view_benchmarks.mask_scores import mask_scores
from scenefw_single_view_benchmarks.outlines import Outlines

SIZES = [(320, 240), (640, 480)]
GRID = GridSpec(32)


EDGES = EdgeRestoration(Projective())


@pytest.mark.parametrize("size", SIZES)
def test_depth_beside_edges_is_nearly_as_if_nothing_were_blurred(size):
    sharp, blurred, _ = seen(size, reach=6)
    view = observation_of(blurred, GRID)
    found, segments = EDGES.restore(view, sharp.labels)
    near = distance_transform_edt(sharp.labels == 0) < 20
    before, after = (np.abs(one - sharp.depth)[near] for one in (blurred.depth, found.depth))
    wrong = before > 0.02
    assert wrong.sum() > 0.002 * sharp.depth.size
    assert (after[wrong] < 0.01).mean() > 0.85
    assert (after > 0.01).sum() < 0.3 * (before > 0.01).sum()
    assert segments is sharp.labels
    # The partial TSDF and the points are those of the restored image, the noise that of the other
    again = observation_of(replace(blurred, depth=found.depth), GRID)
    assert torch.equal(found.partial.distance, again.partial.distance)
    assert not torch.equal(found.partial.distance, view.partial.distance)
    np.testing.assert_array_equal(found.points, again.points)
    assert found.partial.cameras is view.partial.cameras
    assert found.noise == view.noise


@pytest.mark.parametrize(("noise", "alone"), [(0.0, 0.0), (0.001, 0.003)])
def test_images_that_no_stereo_camera_took_are_left_alone(noise, alone):
    """The floor has no noise, or that of each pixel by itself."""
    sharp, frame, _ = seen(SIZES[1], 6 if noise else 0, noise, alone)
    view = observation_of(frame, GRID)
    found, segments = EDGES.restore(view, sharp.labels)
    assert found is view
    assert segments is sharp.labels


@pytest.mark.parametrize("objects", [True, False])
def test_without_ramps_or_objects_depth_stays(objects):
    sharp, frame, _ = seen(SIZES[1], 0 if objects else 6)
    view = observation_of(frame, GRID)
    assert view.noise.is_correlated
    labels = sharp.labels if objects else np.zeros_like(sharp.labels)
    found, segments = EDGES.restore(view, labels)
    assert found is view
    assert segments is labels


def test_two_segments_of_one_surface_go_on_into_each_other():
    """Where they touch there is no jump, so nothing was blurred there."""
    sharp, blurred, _ = seen(SIZES[1], 6)
    halves = sharp.labels * (1 + (np.arange(sharp.labels.shape[1]) > 320)).astype(np.int32)
    found, _ = EDGES.restore(observation_of(blurred, GRID), halves)
    inside = distance_transform_edt(sharp.labels) > 12
    assert inside[:, 318:323].any()
    assert np.array_equal(found.depth[inside], blurred.depth[inside])
    assert (found.depth != blurred.depth).any()


def test_objects_that_are_marked_stay():
    """They stand for segments, and colour doesn't move them."""
    sharp, frame, pixels = seen(SIZES[0], 6)
    far = binary_dilation(sharp.labels > 0, iterations=pixels // 2).astype(np.int32)
    view = observation_of(replace(frame, colour=painted(sharp)), GRID, masks=far)
    edges = EdgeRestoration(Projective(), colour=ColourEdges())
    found, segments = edges.restore(view, far)
    assert segments is far
    assert found.masks is far
    assert not torch.equal(found.partial.depth, view.partial.depth)
    plain, _ = EDGES.restore(observation_of(frame, GRID), far)
    np.testing.assert_array_equal(found.depth, plain.depth)
    assert edges.restore(replace(view, masks=None), far)[1] is not far


def painted(frame):
    """The colours of a frame: objects are red."""
    return np.where(frame.labels[..., None] > 0, [200, 60, 40], [90, 90, 80]).astype(np.uint8)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("reach", [0, 4, 8])
def test_ramps_are_as_wide_as_windows(size, reach):
    sharp, frame, pixels = seen(size, reach, noise=0.0003)
    away = distance_transform_edt(sharp.labels == 0)
    heights = world_points(frame)[..., 2]
    assert ramp_width(heights, away, 12) == pytest.approx(pixels, abs=1 + 0.2 * pixels)


@pytest.mark.parametrize("size", SIZES)
def test_colour_says_where_objects_end(size):
    """Segments whose ends lie three pixels too far out have them back, and so has depth."""
    sharp, blurred, pixels = seen(size, reach=6)
    far = binary_dilation(sharp.labels > 0, iterations=pixels // 2).astype(np.int32)
    colour = painted(sharp)
    view = observation_of(replace(blurred, colour=colour), GRID)
    by_colour = EdgeRestoration(Projective(), colour=ColourEdges())
    plain, far_out = EDGES.restore(view, far)
    found, moved = by_colour.restore(view, far)
    assert (far_out != sharp.labels).sum() > 5 * pixels * pixels
    assert (moved != sharp.labels).sum() < 0.2 * (far != sharp.labels).sum()
    wrong, right = ((np.abs(one.depth - sharp.depth) > 0.01).sum() for one in (plain, found))
    assert right < 0.6 * wrong
    assert found.colour is colour
    # Without a colour image all is as before
    grey, segments = by_colour.restore(observation_of(blurred, GRID), far)
    np.testing.assert_array_equal(segments, far_out)
    np.testing.assert_array_equal(grey.depth, plain.depth)


@given(
    slopes=st.tuples(*[st.floats(-0.001, 0.001)] * 2),
    distance=st.floats(0.5, 2.0),
    width=st.integers(1, 5),
)
def test_a_plane_goes_on_as_a_plane(slopes, distance, width):
    v, u = np.mgrid[:40, :60]
    plane = 1 / (1 / distance + slopes[0] * (u - 30) / 3 + slopes[1] * (v - 20) / 3)
    parts = np.zeros(plane.shape, dtype=np.int32)
    parts[8:32, 10:50] = 1
    depth = plane.astype(np.float32)
    away = distance_transform_edt(parts)
    depth[(parts > 0) & (away <= width)] += 0.05
    found = continued(depth, parts, width)
    assert np.allclose(found[parts > 0], plane[parts > 0], atol=2e-3 * distance**2)
    assert np.array_equal(found[parts == 0], depth[parts == 0])


@pytest.mark.parametrize("size", SIZES)
def test_pixels_of_the_floor_beside_objects_lie_on_it(size):
    sharp, blurred, pixels = seen(size, 6)
    found, _ = EDGES.restore(observation_of(blurred, GRID), sharp.labels)
    changed = (found.depth != blurred.depth) & (sharp.labels == 0)
    assert changed.sum() > 100
    assert distance_transform_edt(sharp.labels == 0)[changed].max() <= 2 * (pixels + 1)
    heights = world_points(replace(blurred, depth=found.depth))[..., 2]
    assert np.abs(heights[changed]).max() < 1e-4


def on_real_image(real_data, folder, name):
    """The restoration that a command builds, an image's observation, and its segments."""
    words = ["run=predict", "input=x", "device=cpu"]
    pipeline = instantiate(config.compose(words).run.pipeline)
    view = pipeline.observe(read_frame(real_data / "real" / folder / f"{name}.npz"))
    return pipeline.edges, view, pipeline.segmentation.segment(view)


def test_of_real_images_those_of_a_stereo_camera_change(real_data):
    edges, view, segments = on_real_image(real_data, "realsense_table", "uois_0")
    found, moved = edges.restore(view, segments)
    assert 0.005 < (found.depth != view.depth).mean() < 0.1
    assert moved.max() > 5
    _, plain = EdgeRestoration(edges.mapping).restore(view, segments)
    file = real_data / "real" / "realsense_table" / "uois_0.npz"
    true = Outlines("realsense_table").of(file)
    by_depth, by_colour = (mask_scores(one, true).boundary_f for one in (plain, moved))
    assert by_colour > by_depth + 0.05


def test_of_real_images_those_of_structured_light_stay(real_data):
    edges, view, segments = on_real_image(real_data, "mosd_learn", "learn13")
    found, same = edges.restore(view, segments)
    assert segments.any()
    assert found is view
    assert same is segments


def test_a_part_without_ends_stays():
    depth = np.full((20, 30), 0.8, np.float32)
    assert np.array_equal(continued(depth, np.ones(depth.shape, np.int32), 3), depth)


def test_a_thin_part_stays():
    depth = np.full((20, 30), 0.8, np.float32)
    parts = np.zeros(depth.shape, np.int32)
    parts[10:13] = 1
    assert np.array_equal(continued(depth, parts, 3), depth)


def test_bad_settings_and_no_images():
    with pytest.raises(ConfigError, match=r"^min_width = 0"):
        EdgeRestoration(Projective(), min_width=0)
    with pytest.raises(ConfigError, match=r"^max_width = 2"):
        EdgeRestoration(Projective(), min_width=3, max_width=2)
    sharp, _, _ = seen(SIZES[0], 6)
    volume = torch.ones(1, 1, *GRID.shape)
    bare = Observation.of_partial(PartialTSDF(volume, volume > 0), GRID)
    with pytest.raises(InputError, match="needs the depth images"):
        EDGES.restore(bare, sharp.labels)
