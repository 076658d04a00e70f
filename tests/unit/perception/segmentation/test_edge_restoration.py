"""Edges of blurred images, against what rays really meet."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from hydra.utils import instantiate
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import (
    binary_dilation,
    distance_transform_edt,
)
from tests.unit.perception.blurred import seen

from scenefw import config
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.types import GridSpec
from scenefw.data.outlines import Outlines
from scenefw.data.readers import read_frame
from scenefw.kernels.cameras import stack_cameras
from scenefw.mapping.projective import Projective
from scenefw.metrics.masks import mask_scores
from scenefw.perception.observation.points import world_points
from scenefw.perception.segmentation.colour_edges import ColourEdges
from scenefw.perception.segmentation.edge_restoration import RestoredEdges, continued
from scenefw.perception.segmentation.ramp_width import ramp_width

SIZES = [(320, 240), (640, 480)]
GRID = GridSpec(32)


class Known:
    """Parts that are known."""

    def __init__(self, labels):
        self.labels = labels

    def segment(self, frame):
        return self.labels


def partial_of(frame):
    depth = torch.from_numpy(frame.depth)[None]
    return Projective().fuse(depth, GRID, stack_cameras([frame.camera]))


@pytest.mark.parametrize("size", SIZES)
def test_depth_beside_edges_is_nearly_as_if_nothing_were_blurred(size):
    sharp, blurred, _ = seen(size, reach=6)
    edges = RestoredEdges(Known(sharp.labels), Projective())
    partial = partial_of(blurred)
    found = edges.of(partial, GRID)
    image = found.depth[0].numpy()
    near = distance_transform_edt(sharp.labels == 0) < 20
    before, after = (np.abs(one - sharp.depth)[near] for one in (blurred.depth, image))
    wrong = before > 0.02
    assert wrong.sum() > 0.002 * sharp.depth.size
    assert (after[wrong] < 0.01).mean() > 0.85
    assert (after > 0.01).sum() < 0.3 * (before > 0.01).sum()
    # The partial TSDF is that of the restored image
    again = partial_of(replace(blurred, depth=image))
    assert torch.equal(found.distance, again.distance)
    assert found.cameras is partial.cameras


@pytest.mark.parametrize(("noise", "alone"), [(0.0, 0.0), (0.001, 0.003)])
def test_images_that_no_stereo_camera_took_are_left_alone(noise, alone):
    """The floor has no noise, or that of each pixel by itself."""
    sharp, frame, _ = seen(SIZES[1], 6 if noise else 0, noise, alone)
    partial = partial_of(frame)
    assert RestoredEdges(Known(sharp.labels), Projective()).of(partial, GRID) is partial


@pytest.mark.parametrize("objects", [True, False])
def test_without_ramps_or_objects_depth_stays(objects):
    """What was found in the image is kept, so that nobody looks again."""
    sharp, frame, _ = seen(SIZES[1], 0 if objects else 6)
    labels = sharp.labels if objects else np.zeros_like(sharp.labels)
    found = RestoredEdges(Known(labels), Projective()).of(partial_of(frame), GRID)
    assert np.array_equal(found.depth[0].numpy(), frame.depth)
    assert np.array_equal(found.parts[0].numpy(), labels)


def test_two_parts_of_one_surface_go_on_into_each_other():
    """Where they touch there is no jump, so nothing was blurred there."""
    sharp, blurred, _ = seen(SIZES[1], 6)
    halves = sharp.labels * (1 + (np.arange(sharp.labels.shape[1]) > 320))
    partial = partial_of(blurred)
    image = RestoredEdges(Known(halves), Projective()).of(partial, GRID).depth[0].numpy()
    inside = distance_transform_edt(sharp.labels) > 12
    assert inside[:, 318:323].any()
    assert np.array_equal(image[inside], blurred.depth[inside])
    assert (image != blurred.depth).any()


def test_objects_that_are_known_stand_for_parts():
    sharp, frame, _ = seen(SIZES[0], 6)
    partial = replace(partial_of(frame), masks=torch.from_numpy(sharp.labels)[None])
    found = RestoredEdges(Known(None), Projective()).of(partial, GRID)
    assert not torch.equal(found.depth, partial.depth)
    assert found.masks is partial.masks


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("reach", [0, 4, 8])
def test_ramps_are_as_wide_as_windows(size, reach):
    sharp, frame, pixels = seen(size, reach, noise=0.0003)
    away = distance_transform_edt(sharp.labels == 0)
    heights = world_points(frame)[..., 2]
    assert ramp_width(heights, away, 12) == pytest.approx(pixels, abs=1 + 0.2 * pixels)


@pytest.mark.parametrize("size", SIZES)
def test_colour_says_where_objects_end(size):
    """Parts whose ends lie three pixels too far out have them back, and so has depth."""
    sharp, blurred, pixels = seen(size, reach=6)
    far = binary_dilation(sharp.labels > 0, iterations=pixels // 2).astype(np.int32)
    paint = np.where(sharp.labels[..., None] > 0, [200, 60, 40], [90, 90, 80]).astype(np.uint8)
    partial = replace(partial_of(blurred), colours=torch.from_numpy(paint)[None])
    plain = RestoredEdges(Known(far), Projective()).of(partial, GRID)
    found = RestoredEdges(Known(far), Projective(), colour=ColourEdges()).of(partial, GRID)
    assert (plain.parts[0].numpy() != sharp.labels).sum() > 5 * pixels * pixels
    assert (found.parts[0].numpy() != sharp.labels).sum() < 0.2 * (far != sharp.labels).sum()
    wrong, right = (
        (np.abs(one.depth[0].numpy() - sharp.depth) > 0.01).sum() for one in (plain, found)
    )
    assert right < 0.6 * wrong
    assert found.colours is partial.colours
    # Without a colour image, or with known objects, all is as before
    grey = replace(partial, colours=None)
    again = RestoredEdges(Known(far), Projective(), colour=ColourEdges()).of(grey, GRID)
    assert torch.equal(again.parts, plain.parts)
    known = replace(partial, masks=torch.from_numpy(far)[None])
    again = RestoredEdges(Known(None), Projective(), colour=ColourEdges()).of(known, GRID)
    assert torch.equal(again.depth, plain.depth)


@given(
    slopes=st.tuples(*[st.floats(-0.001, 0.001)] * 2),
    distance=st.floats(0.5, 2.0),
    width=st.integers(1, 5),
)
@settings(max_examples=30, deadline=None)
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
    partial = partial_of(blurred)
    image = RestoredEdges(Known(sharp.labels), Projective()).of(partial, GRID).depth[0].numpy()
    changed = (image != blurred.depth) & (sharp.labels == 0)
    assert changed.sum() > 100
    assert distance_transform_edt(sharp.labels == 0)[changed].max() <= 2 * (pixels + 1)
    heights = world_points(replace(blurred, depth=image))[..., 2]
    assert np.abs(heights[changed]).max() < 1e-4


def file_of(folder, name):
    beside = Path(__file__).parents[4] / ".." / "shared" / "data"
    return Path(os.environ.get("SCENEFW_DATA", beside)) / "real" / folder / f"{name}.npz"


def real(folder, name):
    """A partial TSDF of a real image, and what cuts it into parts."""
    file = file_of(folder, name)
    if not file.is_file():
        pytest.skip(f"no real image {file} (set SCENEFW_DATA)")
    words = ["run=predict", "input=x", "device=cpu"]
    pipeline = instantiate(config.compose(words).run.pipeline)
    return pipeline, pipeline.prepare(read_frame(file)).partial


def test_of_real_images_those_of_a_stereo_camera_change():
    pipeline, partial = real("realsense_table", "uois_0")
    found = pipeline.reconstructor.edges.of(partial, pipeline.grid)
    changed = (found.depth != partial.depth)[0].numpy()
    assert 0.005 < changed.mean() < 0.1
    assert found.parts.max() > 5
    edges = pipeline.reconstructor.edges
    plain = RestoredEdges(edges.parts, edges.mapping).of(partial, pipeline.grid)
    true = Outlines("realsense_table").of(file_of("realsense_table", "uois_0"))
    by_depth, by_colour = (
        mask_scores(one.parts[0].numpy(), true).boundary_f for one in (plain, found)
    )
    assert by_colour > by_depth + 0.05
    pipeline, partial = real("mosd_learn", "learn13")
    assert pipeline.reconstructor.edges.of(partial, pipeline.grid) is partial


def test_a_part_without_ends_stays():
    depth = np.full((20, 30), 0.8, np.float32)
    assert np.array_equal(continued(depth, np.ones(depth.shape, np.int32), 3), depth)


def test_a_thin_part_stays():
    depth = np.full((20, 30), 0.8, np.float32)
    parts = np.zeros(depth.shape, np.int32)
    parts[10:13] = 1
    assert np.array_equal(continued(depth, parts, 3), depth)


def test_bad_settings_and_no_images():
    with pytest.raises(ConfigError, match=r"^narrowest = 0"):
        RestoredEdges(Known(None), Projective(), narrowest=0)
    with pytest.raises(ConfigError, match=r"^widest = 2"):
        RestoredEdges(Known(None), Projective(), narrowest=3, widest=2)
    with pytest.raises(ConfigError, match=r"^jump = 0"):
        RestoredEdges(Known(None), Projective(), jump=0)
    sharp, frame, _ = seen(SIZES[0], 6)
    partial = replace(partial_of(frame), depth=None)
    with pytest.raises(InputError, match="restoring edges needs the depth images"):
        RestoredEdges(Known(sharp.labels), Projective()).of(partial, GRID)
