import json
import warnings
from dataclasses import replace

import numpy as np
import pytest
import torch
from hydra.utils import instantiate
from scipy.ndimage import gaussian_filter
from tests.unit.perception.synthetic import STACK, Box, camera_at, frame_of

from scenefw import config
from scenefw.core.batches import Completion, PartialTSDF
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.types import GridSpec
from scenefw.export.summary import plain
from scenefw.mapping.projective import Projective
from scenefw.perception.observation.view_frames import seen_frames
from scenefw.perception.pipeline import Pipeline
from scenefw.postprocessing.confidence import Calibration


class KnownBoxes:
    """Answers with the true boxes, turned into the frame that the pipeline has found."""

    calibration = None

    def __init__(self, grid, boxes=STACK):
        self.grid = grid
        self.metadata = {"made": "by hand"}
        self.boxes = boxes
        self.seen = []

    def complete(self, partial, grid, samples, generator):
        self.seen.append((partial, torch.rand(1, generator=generator).item()))
        fields = np.stack([self._distance(grid, box) for box in self.boxes])
        tsdf = fields.min(axis=0).clip(-grid.truncation, grid.truncation)
        instances = np.where(tsdf < 0, fields.argmin(axis=0) + 1, 0)
        tsdf, instances = torch.from_numpy(tsdf).float(), torch.from_numpy(instances).int()
        return [Completion(tsdf[None], instances[None], {"mine": tsdf[None, None]})] * samples

    @staticmethod
    def _distance(grid, box):
        """Signed distance of a box, exact (Quilez)."""
        lower, upper = np.array(box.lower), np.array(box.upper)
        q = np.abs(grid.centres() - (lower + upper) / 2) - (upper - lower) / 2
        return np.linalg.norm(q.clip(min=0), axis=-1) + q.max(axis=-1).clip(max=0)


# Seen along +y, so that the frame that is found differs by a shift along y alone.
CAMERA = camera_at(eye=(0.0, -0.85, 0.6))


@pytest.mark.parametrize("resolution", [32, 64])
def test_objects_of_a_known_scene(resolution):
    grid = GridSpec(resolution=resolution)
    pipeline = Pipeline(KnownBoxes(grid), Projective(), samples=3)
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
    method = KnownBoxes(grid)
    frame = frame_of(CAMERA)
    view = Pipeline(method, Projective()).prepare(frame)
    truth = method.complete(view.partial, grid, 1, torch.Generator())[0].tsdf
    partial: PartialTSDF = view.partial
    x, y, z = np.moveaxis(grid.centres(), -1, 0)
    top = (np.abs(x) < 0.03) & (y > 0.0) & (y < 0.04) & (np.abs(z - 0.2) < 1.5 * grid.voxel_size)
    assert top.sum() >= 2
    seen = partial.distance[0, 0].numpy()
    assert partial.observed[0, 0].numpy()[top & (z > 0.2)].all()
    assert ((seen > 0) == (truth[0].numpy() > 0))[top].mean() > 0.9
    floor = (x > 0.2) & (x < 0.3) & (np.abs(y) < 0.2) & (z > 0) & (z < 2 * grid.voxel_size)
    assert (np.abs(seen[floor]) < 4 * grid.voxel_size).all()


def test_same_image_same_estimate():
    grid = GridSpec(resolution=32)
    method = KnownBoxes(grid)
    pipeline = Pipeline(method, Projective(), seed=7)
    frame = frame_of(CAMERA)
    first, second = pipeline.estimate(frame), pipeline.estimate(frame)
    np.testing.assert_array_equal(first.tsdf, second.tsdf)
    assert method.seen[0][1] == method.seen[1][1]
    other = KnownBoxes(grid)
    Pipeline(other, Projective(), seed=8).estimate(frame)
    assert other.seen[0][1] != method.seen[0][1]


class Growing(KnownBoxes):
    """Every further sample is 7 mm fatter, and numbers its objects the other way round."""

    def complete(self, partial, grid, samples, generator):
        (first, *_) = super().complete(partial, grid, samples, generator)
        tsdf = first.tsdf
        nearest = torch.stack(
            [torch.from_numpy(self._distance(grid, box)).float() for box in self.boxes]
        ).argmin(dim=0)
        found = [first]
        for number in range(1, samples):
            fatter = tsdf - 0.007 * number
            instances = torch.where(fatter < 0, 2 - nearest[None], 0).int()
            found.append(Completion(fatter, instances))
        return found


@pytest.mark.parametrize("resolution", [48, 64])
def test_hypotheses_keep_the_ids_of_objects_and_agree_less_the_more_they_differ(resolution):
    grid = GridSpec(resolution=resolution)
    pipeline = Pipeline(Growing(grid), Projective(), samples=3, carve=False)
    view = pipeline.prepare(frame_of(CAMERA))
    first, second, third = pipeline.hypotheses(view)
    for other in (second, third):
        assert [item.id for item in other.objects] == [1, 2]
        for mine, its in zip(first.objects, other.objects, strict=True):
            apart = np.subtract(mine.pose.position, its.pose.position)
            assert np.abs(apart).max() < 2 / resolution
            assert np.prod(its.extents) > np.prod(mine.extents)
    between, outer = (scene.objects[0].confidence for scene in (second, first))
    assert between > outer > 0
    np.testing.assert_array_equal(pipeline.complete(view).tsdf, first.tsdf)


def test_carving_can_be_switched_off():
    grid = GridSpec(resolution=32)
    ghost = (*STACK, type(STACK[0])((-0.1, -0.35, 0.05), (0.1, -0.25, 0.2)))
    frame = frame_of(CAMERA)
    carved = Pipeline(KnownBoxes(grid, ghost), Projective()).estimate(frame)
    kept = Pipeline(KnownBoxes(grid, ghost), Projective(), carve=False).estimate(frame)
    assert len(carved.objects) == 2
    assert len(kept.objects) == 3


def test_a_network_that_sees_nothing_gives_no_object():
    grid = GridSpec(resolution=32)
    far = (type(STACK[0])((5, 5, 5), (6, 6, 6)),)
    estimate = Pipeline(KnownBoxes(grid, far), Projective()).estimate(frame_of(CAMERA))
    assert estimate.objects == ()


def test_methods_see_the_colour_of_the_image():
    """Also of a picture that can't be written to, as PIL gives it."""
    frame = frame_of(CAMERA, noise=0.001)
    colour = np.random.default_rng(0).integers(0, 256, (*frame.depth.shape, 3), dtype=np.uint8)
    colour.flags.writeable = False
    pipeline = Pipeline(KnownBoxes(GridSpec(32)), Projective())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        partial = pipeline.prepare(replace(frame, colour=colour)).partial
    (seen,) = seen_frames(partial, "a test")
    np.testing.assert_array_equal(seen.colour, colour)
    (grey,) = seen_frames(pipeline.prepare(frame).partial, "a test")
    assert grey.colour is None


def test_unusable_images_stop_before_the_network():
    method = KnownBoxes(GridSpec(resolution=32))
    frame = frame_of(CAMERA, boxes=())
    with pytest.raises(InputError, match="nothing stands"):
        Pipeline(method, Projective()).prepare(frame, np.ones(frame.depth.shape, bool))
    with pytest.raises(InputError, match="no measurements"):
        Pipeline(method, Projective()).estimate(replace(frame, depth=frame.depth * 0))
    assert method.seen == []


def test_a_bare_table_is_an_empty_scene_with_a_warning():
    grid, far = GridSpec(resolution=32), (type(STACK[0])((5, 5, 5), (6, 6, 6)),)
    for size in ((160, 120), (320, 240)):
        frame = frame_of(camera_at(size=size), boxes=(), noise=0.001)
        estimate = Pipeline(KnownBoxes(grid, far), Projective()).estimate(frame)
        assert estimate.objects == ()
        (warning,) = estimate.details["warnings"]
        assert warning.startswith("nothing stands on the floor, or only what is flat; check that")
        height = camera_at(size=size).T_world_camera[2, 3]
        assert estimate.details["floor"]["height"] == pytest.approx(height, abs=0.002)


@pytest.mark.parametrize("waves", [0.0, 0.003])
def test_the_pipeline_that_ships_finds_nothing_on_a_bare_table(waves):
    """Nor does it take noise or waves of the floor for objects."""
    pipeline = _shipped()
    frame = frame_of(camera_at(size=(320, 240)), boxes=(), noise=0.001)
    noise = gaussian_filter(np.random.default_rng(1).normal(size=frame.depth.shape), 4)
    smooth = (waves / noise.std() * noise).astype(np.float32)
    estimate = pipeline.estimate(replace(frame, depth=frame.depth + smooth))
    assert estimate.objects == ()
    assert estimate.details["warnings"]


def _shipped():
    words = ["run=predict", "input=x", "device=cpu", "run.pipeline.samples=1"]
    return instantiate(config.compose(words).run.pipeline)


@pytest.mark.parametrize("count", [1, 16])
def test_the_pipeline_that_ships_finds_one_object_and_sixteen(count):
    places = [(0.15 * (i % 4) - 0.225, 0.15 * (i // 4)) for i in range(count)]
    boxes = [Box((x - 0.03, y - 0.03, 0.0), (x + 0.03, y + 0.03, 0.06)) for x, y in places]
    camera = camera_at(eye=(0.1, -0.5, 0.9), target=(0.0, 0.2, 0.0), size=(640, 480))
    estimate = _shipped().estimate(frame_of(camera, boxes=boxes, noise=0.0005))
    assert len(estimate.objects) == count
    for item in estimate.objects:
        np.testing.assert_allclose(np.sort(item.extents), 0.06, atol=0.012)


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
        Pipeline(KnownBoxes(GridSpec(resolution=16)), Projective(), samples=0)


class OtherNumbers(KnownBoxes):
    """Numbers objects anew in every sample, and says which pixels show them."""

    def complete(self, partial, grid, samples, generator):
        (first, *others) = super().complete(partial, grid, samples, generator)
        drawn = torch.zeros(1, 240, 320, dtype=torch.int32)
        drawn[:, :100], drawn[:, 200:] = 1, 2
        swapped = torch.tensor([0, 2, 1], dtype=torch.int32)
        found = [replace(first, masks=drawn)]
        for other in others:
            labels, masks = swapped[other.instances.long()], swapped[drawn.long()]
            found.append(replace(other, instances=labels, masks=masks))
        return found


def test_masks_keep_the_numbers_of_their_objects():
    pipeline = Pipeline(OtherNumbers(GridSpec(resolution=32)), Projective(), samples=3)
    for estimate in pipeline.hypotheses(pipeline.prepare(frame_of(CAMERA, noise=0.001))):
        below, above = (np.unique(estimate.masks[rows]) for rows in (np.s_[:100], np.s_[200:]))
        assert below.tolist() == [1]
        assert above.tolist() == [2]


def test_confidence_is_what_the_method_says_of_agreement():
    class Half(KnownBoxes):
        calibration = Calibration([0.0, 1.0], [0.1, 0.5])

    scene = Pipeline(Half(GridSpec(resolution=32)), Projective(), samples=2).estimate(
        frame_of(CAMERA)
    )
    assert [item.confidence for item in scene.objects] == pytest.approx([0.5] * len(scene.objects))
