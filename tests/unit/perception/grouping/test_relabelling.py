"""Segments and rough volumes that become objects: drawn images, boxes, real images."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hydra.utils import instantiate
from tests.unit.perception.blurred import seen
from tests.unit.perception.grouping.test_merging import LONG, merging
from tests.unit.perception.observations import observation_of
from tests.unit.perception.synthetic import STACK, camera_at, frame_of

from scenefw import config
from scenefw.core.batches import PartialTSDF
from scenefw.core.errors import InputError
from scenefw.core.types import GridSpec
from scenefw.data.files.readers import read_frame
from scenefw.perception.evidence.visible_instances import visible_instances
from scenefw.perception.grouping.hulls import HullFilling
from scenefw.perception.grouping.relabelling import ObjectGrouping, reassigned
from scenefw.perception.observation.observation import Observation
from scenefw.perception.segmentation.crease_segmentation import CreaseSegmentation
from scenefw.perception.steps import Objects
from scenefw_single_view_benchmarks.mask_scores import mask_scores

EYE = (0.0, -0.85, 0.6)


class Fixed:
    """Answers with rough volumes made beforehand."""

    def __init__(self, instances):
        self.instances = instances

    def group(self, segments, view):
        tsdf = np.where(self.instances > 0, -0.01, 0.01).astype(np.float32)
        volumes = {"mine": torch.from_numpy(tsdf)[None, None]}
        return Objects(segments, tsdf, self.instances, volumes)


class Step:
    """Splits or merges: adds a number to all labels, so that the order can be read."""

    def __init__(self, change):
        self.change = change

    def split(self, parts, view):
        return np.where(parts > 0, self.change(parts), 0).astype(np.int32)

    def merge(self, parts, view, depth):
        assert depth is view.depth
        return self.split(parts, view)


def grouping_of(rough, split=None, merge=None):
    """The step of a pipeline, which learns nothing and asks nobody else."""
    return ObjectGrouping(rough, split, merge)


def view_of_boxes(resolution, boxes=STACK):
    """The observation of boxes, which pixels show them, and (X, Y, Z) which voxels are theirs."""
    grid, camera = GridSpec(resolution=resolution), camera_at(eye=EYE)
    frame = replace(frame_of(camera, boxes), camera=camera)
    inside = [
        np.all((grid.centres() > box.lower) & (grid.centres() < box.upper), axis=-1)
        for box in boxes
    ]
    volumes = np.select(inside, np.arange(1, len(boxes) + 1), 0).astype(np.int32)
    return observation_of(frame, grid), frame.labels, volumes


@pytest.mark.parametrize("resolution", [16, 32])
def test_voxels_go_to_the_object_that_is_seen_nearest(resolution):
    grid = GridSpec(resolution=resolution)
    centres = grid.centres()
    middle = (np.asarray(grid.lower) + grid.extent / 2).round(6)
    inside = np.abs(centres - middle).max(axis=-1) < 0.3 * grid.extent
    instances = np.where(inside, 3, 0).astype(np.int32)
    instances[0, 0, 0] = 8  # seen by nobody
    xs = np.linspace(-0.3, 0.3, 41) * grid.extent
    x, y = np.meshgrid(xs, xs, indexing="ij")
    points = middle + np.stack([x, y, np.full_like(x, 0.31)], axis=-1)
    objects = np.where(x < 0, 1, 2).astype(np.int32)
    objects[0, 0] = 7  # of a neighbour: too few pixels to get voxels
    found = reassigned(instances, np.full(objects.shape, 3, np.int32), objects, points, grid)
    left = centres[..., 0] < middle[0]
    assert (found[inside & left] == 1).all()
    assert (found[inside & ~left] == 2).all()
    assert found[0, 0, 0] == 8  # a number that no object has
    assert ((found > 0) == (instances > 0)).all()


@pytest.mark.parametrize("resolution", [32, 64])
def test_segments_divide_a_rough_volume_of_two_boxes(resolution):
    """And masks agree with volumes; other volumes come through."""
    view, labels, boxes = view_of_boxes(resolution)
    one = (boxes > 0).astype(np.int32)
    segments = CreaseSegmentation(min_pixels=2000).segment(view)
    objects = grouping_of(Fixed(one)).group(segments, view)
    found = objects.instances
    assert len(np.unique(found[found > 0])) == 2
    for label in (1, 2):
        votes = np.bincount(found[(boxes == label) & (found > 0)])
        assert votes.max() > 0.65 * votes.sum()  # the nearest seen point is no more than a guess
        same_pixels = objects.masks[(labels == label) & (objects.masks > 0)]
        assert (same_pixels == votes.argmax()).mean() > 0.95
    assert set(np.unique(objects.masks)) == {0, *np.unique(found[found > 0])}
    assert objects.volumes.keys() == {"mine"}
    assert ((found > 0) == (one > 0)).all()


@pytest.mark.parametrize("resolution", [32, 64])
def test_segments_are_merged_whatever_the_rough_volumes(resolution):
    view, labels, boxes = view_of_boxes(resolution, (LONG,))
    right = view.points[..., 0] > 0
    halves = np.where(right, 2 * labels, labels).astype(np.int32)
    objects = grouping_of(Fixed(boxes), merge=merging()).group(halves, view)
    assert len(np.unique(objects.masks)) == 2
    np.testing.assert_array_equal(objects.masks > 0, labels > 0)
    np.testing.assert_array_equal(objects.instances > 0, boxes > 0)


def test_segments_are_split_then_merged():
    view, labels, boxes = view_of_boxes(32)
    add, double = (Step(one) for one in (lambda k: k + 1, lambda k: 2 * k))
    objects = grouping_of(Fixed(boxes), add, double).group(labels, view)
    expected = np.where(labels > 0, 2 * (labels + 1), 0)
    np.testing.assert_array_equal(objects.masks, expected)
    assert set(np.unique(objects.instances)) == set(np.unique(expected))


@pytest.mark.parametrize("resolution", [32, 64])
def test_marked_objects_stay(resolution):
    view, labels, boxes = view_of_boxes(resolution)
    one = (labels > 0).astype(np.int32)
    change = Step(lambda parts: parts + 1)
    grouping = grouping_of(Fixed(boxes), change, change)
    free, marked = (grouping.group(one, k) for k in (view, replace(view, masks=one)))
    assert set(np.unique(free.masks)) == {0, 3}
    np.testing.assert_array_equal(marked.masks, one)
    np.testing.assert_array_equal(marked.instances > 0, boxes > 0)
    assert set(np.unique(marked.instances)) == {0, 1}


@pytest.mark.parametrize("size", [(320, 240), (640, 480)])
def test_ramps_of_blurred_edges_are_no_objects_unless_marked(size):
    sharp, blurred, _ = seen(size, reach=7)
    view = observation_of(blurred, GridSpec(resolution=32))
    ramp = view.mixed & (sharp.labels == 0)
    assert ramp.any()
    segments = np.where(ramp, 2, sharp.labels).astype(np.int32)
    grouping = grouping_of(HullFilling())
    objects = grouping.group(segments, view)
    np.testing.assert_array_equal(objects.masks, np.where(ramp, 0, segments))
    marked = grouping.group(segments, replace(view, masks=segments))
    np.testing.assert_array_equal(marked.masks, segments)


@pytest.mark.parametrize("resolution", [32, 64])
def test_hulls_are_those_of_the_segments_alone(resolution):
    """What they leave to the floor isn't filled, though creases would make a segment of it."""
    view, _, _ = view_of_boxes(resolution)
    both = CreaseSegmentation(min_pixels=2000).segment(view)
    first = np.where(both == 1, 1, 0).astype(np.int32)
    for segments in (both, first):
        objects = grouping_of(HullFilling()).group(segments, view)
        np.testing.assert_array_equal(np.unique(objects.instances), np.unique(segments))
        np.testing.assert_array_equal(np.unique(objects.masks), np.unique(segments))
    assert both.max() == 2


def test_a_step_without_volumes_or_a_view_without_image_is_refused():
    view, labels, boxes = view_of_boxes(32)

    class Flat:
        def group(self, segments, view):
            return Objects(segments)

    with pytest.raises(TypeError, match="without volumes"):
        grouping_of(Flat()).group(labels, view)
    bare = PartialTSDF(view.partial.distance, view.partial.observed)
    with pytest.raises(InputError, match="depth images"):
        grouping_of(Fixed(boxes)).group(labels, Observation.of_partial(bare, view.grid))


def on_real_image(real_data, name, reconstructor):
    """The grouping that a command builds, an image with hand-made labels, and its segments."""
    words = [f"reconstructor={reconstructor}", "run=predict", "input=x", "device=cpu"]
    pipeline = instantiate(config.compose(words).run.pipeline)
    frame = read_frame(real_data / "real" / "mosd_learn" / f"{name}.npz")
    grid = pipeline.grid or GridSpec(resolution=64)
    view = pipeline.observer.observe(frame, grid)
    return pipeline.grouping, frame.labels, view, pipeline.segmentation.segment(view)


@pytest.mark.parametrize("name", ["learn00", "learn29"])
def test_real_images(real_data, name):
    """The network alone joins two boxes on one, segments alone divide an object on the other."""
    grouping, labels, view, segments = on_real_image(real_data, name, "fitted")
    assert mask_scores(grouping.group(segments, view).masks, labels).overlap_f > 0.95
    rough = grouping.rough.group(segments, view)
    shown = visible_instances(rough.instances, view.points, view.grid, view.heights > 0.005)
    assert min(mask_scores(one, labels).overlap_f for one in (shown, segments)) < 0.8


def test_segments_of_a_real_image_are_merged_by_evidence(real_data):
    """Fine segments divide its objects; merged, they have the hand-made borders."""
    grouping, labels, view, segments = on_real_image(real_data, "learn29", "fitted_hulls")
    assert mask_scores(grouping.group(segments, view).masks, labels).overlap_f > 0.95
    assert mask_scores(segments, labels).overlap_f < 0.85
