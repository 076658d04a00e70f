import functools
import json
import warnings
from dataclasses import replace

import numpy as np
import pytest
from hydra.utils import instantiate
from scipy.ndimage import gaussian_filter
from scipy.special import expit
from tests.unit.perception.pipelines import KnownBoxes, pipeline_of
from tests.unit.perception.synthetic import STACK, Box, camera_at, frame_of

from scenefw import config
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.types import GridSpec
from scenefw.export.summary import plain
from scenefw.perception.estimate.assembly import SceneAssembly
from scenefw.perception.pipeline import ReconstructionPipeline
from scenefw.perception.steps import Objects, ObjectSet
from scenefw.postprocessing.confidence import ExpectedOverlap

# Seen along +y, so that the frame that is found differs by a shift along y alone.
CAMERA = camera_at(eye=(0.0, -0.85, 0.6))


@pytest.mark.parametrize("resolution", [32, 64])
def test_objects_of_a_known_scene(resolution):
    grid = GridSpec(resolution=resolution)
    pipeline = pipeline_of(KnownBoxes(grid), samples=3)
    estimate = pipeline.estimate(frame_of(CAMERA, noise=0.001))
    assert [item.id for item in estimate.objects] == [1, 2]
    below, above = estimate.objects
    assert below.confidence > 0.9
    np.testing.assert_allclose(np.sort(below.extents), (0.12, 0.16, 0.20), atol=1.2 / resolution)
    np.testing.assert_allclose(above.pose.position[2], 0.16, atol=1 / resolution)
    assert estimate.tsdf.shape == estimate.instances.shape == grid.shape
    assert estimate.volumes["mine"].shape == (1, *grid.shape)
    true = frame_of(CAMERA).labels
    assert np.mean(estimate.masks[true > 0] == true[true > 0]) > 0.9
    assert np.mean(estimate.masks[true == 0] > 0) < 0.02
    json.dumps(plain(estimate.details), allow_nan=False)


@pytest.mark.parametrize("resolution", [32, 64])
def test_partial_tsdf_is_zero_on_seen_surfaces(resolution):
    grid = GridSpec(resolution=resolution)
    boxes = KnownBoxes(grid)
    partial = pipeline_of(boxes).observe(frame_of(CAMERA)).partial
    truth, _ = boxes.volumes(grid)
    x, y, z = np.moveaxis(grid.centres(), -1, 0)
    top = (np.abs(x) < 0.03) & (y > 0.0) & (y < 0.04) & (np.abs(z - 0.2) < 1.5 * grid.voxel_size)
    assert top.sum() >= 2
    seen = partial.distance[0, 0].numpy()
    assert partial.observed[0, 0].numpy()[top & (z > 0.2)].all()
    assert ((seen > 0) == (truth > 0))[top].mean() > 0.9
    floor = (x > 0.2) & (x < 0.3) & (np.abs(y) < 0.2) & (z > 0) & (z < 2 * grid.voxel_size)
    assert (np.abs(seen[floor]) < 4 * grid.voxel_size).all()


def test_same_image_same_estimate():
    grid = GridSpec(resolution=32)
    boxes = KnownBoxes(grid)
    pipeline = pipeline_of(boxes, seed=7)
    frame = frame_of(CAMERA)
    first, second = pipeline.estimate(frame), pipeline.estimate(frame)
    np.testing.assert_array_equal(first.tsdf, second.tsdf)
    (_, number), (_, again) = boxes.requests
    assert number == again
    pipeline_of(boxes, seed=8).estimate(frame)
    assert boxes.requests[-1][1] != number


class Growing(KnownBoxes):
    """Every further sample is 7 mm fatter, and numbers its objects the other way round."""

    def complete(self, fits, view, samples, generator):
        first = super().complete(fits, view, 1, generator)[0]
        nearest = self.distances(view.grid).argmin(axis=0)
        sets = [first]
        for number in range(1, samples):
            tsdf = first.objects.tsdf - np.float32(0.007 * number)
            instances = np.where(tsdf < 0, 2 - nearest, 0).astype(np.int32)
            sets.append(ObjectSet(Objects(None, tsdf, instances)))
        return sets


def test_hypotheses_keep_the_ids_of_objects_and_agree_less_the_more_they_differ():
    grid = GridSpec(resolution=48)
    pipeline = pipeline_of(Growing(grid), samples=3, carve=False)
    view = pipeline.observe(frame_of(CAMERA))
    first, second, third = pipeline.reconstruct(view)
    for other in (second, third):
        assert [item.id for item in other.objects] == [1, 2]
        for mine, its in zip(first.objects, other.objects, strict=True):
            apart = np.subtract(mine.pose.position, its.pose.position)
            assert np.abs(apart).max() < 2 / 48
            assert np.prod(its.extents) > np.prod(mine.extents)
    between, outer = (scene.objects[0].confidence for scene in (second, first))
    assert between > outer > 0
    (alone,) = pipeline.reconstruct(view, first_only=True)
    np.testing.assert_array_equal(alone.tsdf, first.tsdf)
    assert [item.confidence for item in alone.objects] == [
        item.confidence for item in first.objects
    ]


def test_carving_can_be_switched_off():
    grid = GridSpec(resolution=32)
    ghost = (*STACK, Box((-0.1, -0.35, 0.05), (0.1, -0.25, 0.2)))
    frame = frame_of(CAMERA)
    carved = pipeline_of(KnownBoxes(grid, ghost)).estimate(frame)
    kept = pipeline_of(KnownBoxes(grid, ghost), carve=False).estimate(frame)
    assert len(carved.objects) == 2
    assert len(kept.objects) == 3


def test_a_network_that_sees_nothing_gives_no_object():
    grid = GridSpec(resolution=32)
    far = (Box((5, 5, 5), (6, 6, 6)),)
    estimate = pipeline_of(KnownBoxes(grid, far)).estimate(frame_of(CAMERA))
    assert estimate.objects == ()


class NoObject:
    """A segmentation that finds nothing, and keeps the views that it is shown."""

    def __init__(self):
        self.views = []

    def segment(self, view):
        self.views.append(view)
        return np.zeros(view.depth.shape, np.int32)


def test_methods_see_the_colour_of_the_image():
    """Also of a picture that can't be written to, as PIL gives it."""
    frame = frame_of(CAMERA, noise=0.001)
    colour = np.random.default_rng(0).integers(0, 256, (*frame.depth.shape, 3), dtype=np.uint8)
    colour.flags.writeable = False
    segmentation = NoObject()
    pipeline = pipeline_of(KnownBoxes(GridSpec(32)), segmentation=segmentation)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pipeline.estimate(replace(frame, colour=colour))
    pipeline.estimate(frame)
    coloured, grey = segmentation.views
    np.testing.assert_array_equal(coloured.colour, colour)
    assert grey.colour is None


def test_unusable_images_stop_before_the_network():
    boxes = KnownBoxes(GridSpec(resolution=32))
    frame = frame_of(CAMERA, boxes=())
    with pytest.raises(InputError, match="nothing stands"):
        pipeline_of(boxes).observe(frame, np.ones(frame.depth.shape, bool))
    with pytest.raises(InputError, match="no measurements"):
        pipeline_of(boxes).estimate(replace(frame, depth=frame.depth * 0))
    assert boxes.requests == []


def test_a_bare_table_is_an_empty_scene_with_a_warning():
    grid, far = GridSpec(resolution=32), (Box((5, 5, 5), (6, 6, 6)),)
    for size in ((160, 120), (320, 240)):
        frame = frame_of(camera_at(size=size), boxes=(), noise=0.001)
        estimate = pipeline_of(KnownBoxes(grid, far)).estimate(frame)
        assert estimate.objects == ()
        (warning,) = estimate.details["warnings"]
        assert warning.startswith("nothing stands on the floor, or only what is flat; check that")
        height = camera_at(size=size).T_world_camera[2, 3]
        assert estimate.details["floor"]["height"] == pytest.approx(height, abs=0.002)


def test_the_pipeline_that_ships_finds_nothing_on_a_bare_table():
    """Nor does it take noise or waves of the floor for objects."""
    pipeline = _shipped()
    frame = frame_of(camera_at(size=(320, 240)), boxes=(), noise=0.001)
    noise = gaussian_filter(np.random.default_rng(1).normal(size=frame.depth.shape), 4)
    smooth = (0.003 / noise.std() * noise).astype(np.float32)
    estimate = pipeline.estimate(replace(frame, depth=frame.depth + smooth))
    assert estimate.objects == ()
    assert estimate.details["warnings"]


@functools.cache
def _shipped():
    words = ["run=predict", "input=x", "device=cpu", "reconstructor.samples=1"]
    return instantiate(config.compose(words).run.pipeline)


def test_the_pipeline_that_ships_finds_sixteen_objects():
    places = [(0.15 * (i % 4) - 0.225, 0.15 * (i // 4)) for i in range(16)]
    boxes = [Box((x - 0.03, y - 0.03, 0.0), (x + 0.03, y + 0.03, 0.06)) for x, y in places]
    camera = camera_at(eye=(0.1, -0.5, 0.9), target=(0.0, 0.2, 0.0), size=(640, 480))
    estimate = _shipped().estimate(frame_of(camera, boxes=boxes, noise=0.0005))
    assert len(estimate.objects) == 16
    for item in estimate.objects:
        np.testing.assert_allclose(np.sort(item.extents), 0.06, atol=0.012)


@pytest.mark.parametrize("size", [(320, 240), (640, 480)])
@pytest.mark.parametrize("noise", [0.0, 0.0005])
def test_the_pipeline_that_ships_finds_a_phone(size, noise):
    phone = Box((0.18, -0.1, 0.0), (0.26, 0.05, 0.009))
    frame = frame_of(camera_at(size=size), (*STACK, phone), noise=noise)
    estimate = _shipped().estimate(frame)
    pixels = frame.labels == 3
    label = np.bincount(estimate.masks[pixels]).argmax()
    mask = estimate.masks == label
    assert label > 0
    assert (mask & pixels).sum() > 0.8 * (mask | pixels).sum()
    (item,) = (item for item in estimate.objects if item.id == label)
    np.testing.assert_allclose(np.sort(item.extents), (0.009, 0.08, 0.15), atol=0.02)
    assert item.extents.min() < 0.014


@pytest.mark.parametrize("side", ["left", "lower"])
def test_the_pipeline_that_ships_makes_do_with_half_an_image(side):
    """What half an image shows is found; objects of which nothing is left are not made up."""
    boxes = [Box((x - 0.04, -0.04, 0.0), (x + 0.04, 0.04, 0.1)) for x in (-0.16, 0.16)]
    frame = frame_of(camera_at(size=(640, 480)), boxes=boxes, noise=0.0005)
    depth = frame.depth.copy()
    if side == "left":
        depth[:, 320:] = 0
    else:
        depth[:240] = 0
    estimate = _shipped().estimate(replace(frame, depth=depth))
    assert len(estimate.objects) == (1 if side == "left" else 2)
    assert np.isfinite(estimate.tsdf).all()


def test_no_sample_at_all_is_one_line():
    with pytest.raises(ConfigError, match="samples = 0"):
        pipeline_of(KnownBoxes(GridSpec(resolution=16)), samples=0)


class OtherNumbers(KnownBoxes):
    """Numbers objects anew in every sample, and says which pixels show them."""

    def complete(self, fits, view, samples, generator):
        (first, *others) = super().complete(fits, view, samples, generator)
        masks = np.zeros(view.depth.shape, np.int32)
        masks[:100], masks[200:] = 1, 2
        swapped = np.array([0, 2, 1], np.int32)
        labels = first.objects.instances
        return [
            ObjectSet(replace(first.objects, masks=masks)),
            *(
                ObjectSet(replace(other.objects, masks=swapped[masks], instances=swapped[labels]))
                for other in others
            ),
        ]


def test_masks_keep_the_numbers_of_their_objects():
    pipeline = pipeline_of(OtherNumbers(GridSpec(resolution=32)), samples=3)
    for estimate in pipeline(frame_of(CAMERA, noise=0.001)):
        below, above = (np.unique(estimate.masks[rows]) for rows in (np.s_[:100], np.s_[200:]))
        assert below.tolist() == [1]
        assert above.tolist() == [2]


def test_confidence_is_what_the_calibration_says_of_cues():
    boxes = KnownBoxes(GridSpec(resolution=32))
    calibration = ExpectedOverlap(["agreement", "fill"], [1.0, 0.0], [1.0, 1.0], [3.0, 0.5], -2.0)
    scene = pipeline_of(boxes, calibration=calibration, samples=2).estimate(frame_of(CAMERA))
    for item in scene.objects:
        assert 0.5 < item.cues["fill"] <= 1
        logit = 3 * (item.cues["agreement"] - 1) + 0.5 * item.cues["fill"] - 2
        assert item.confidence == pytest.approx(expit(logit))


def test_an_image_needs_an_observer_and_a_grid():
    frame, boxes = frame_of(CAMERA), KnownBoxes(None)
    with pytest.raises(ConfigError, match=r"no grid; give .reconstructor\.grid="):
        pipeline_of(boxes).observe(frame)
    assert pipeline_of(boxes, grid=GridSpec(resolution=32)).observe(frame).grid.resolution == 32
    blind = ReconstructionPipeline(SceneAssembly(), completion=boxes, grid=GridSpec(resolution=32))
    with pytest.raises(ConfigError, match=r"no observer; give .reconstructor\.observer="):
        blind.estimate(frame)
