"""Instances regrouped by parts of the image: rules on drawn images, volumes, real images."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from hydra.utils import instantiate
from tests.unit.perception.synthetic import STACK, camera_at, frame_of

from scenefw import config
from scenefw.core.batches import Completion, PartialTSDF
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.types import GridSpec
from scenefw.data.readers import read_frame
from scenefw.kernels.cameras import stack_cameras
from scenefw.metrics.masks import mask_scores
from scenefw.perception.grouping.division import GroupedByNetwork, divide
from scenefw.perception.grouping.hulls import HullFilling
from scenefw.perception.grouping.relabelling import PartGuided, reassigned
from scenefw.perception.segmentation.crease_segmentation import SeenParts


class Fixed:
    """Answers with instances made beforehand."""

    def __init__(self, grid, instances):
        self.grid, self.metadata, self.instances = grid, {"made": "by hand"}, instances

    def complete(self, partial, grid, samples, generator):
        tsdf = torch.where(self.instances > 0, -0.01, 0.01)
        return [Completion(tsdf, self.instances, {"mine": tsdf[:, None]})] * samples


def drawn(*rows, scale=40):
    """An image of digits, each pixel of which becomes a square."""
    image = np.array([[int(digit) for digit in row] for row in rows], np.int32)
    return image.repeat(scale, axis=0).repeat(scale, axis=1)


def same(labels, expected):
    """Whether two images have the same regions, however they are numbered."""
    pairs = np.unique(np.stack([labels.ravel(), expected.ravel()]), axis=1)
    counts = [len(np.unique(side)) for side in (labels, expected)]
    return counts == [pairs.shape[1]] * 2 and ((labels == 0) == (expected == 0)).all()


PARTS = drawn("00000", "11233", "11233", "00200")


def test_what_hides_an_object_leaves_two_parts_of_it():
    shown = drawn("00000", "55755", "55755", "00700")
    assert same(GroupedByNetwork().join(PARTS, shown), drawn("00000", "11211", "11211", "00200"))


def test_parts_that_touch_stay_apart_and_fragments_join():
    shown = drawn("00000", "77755", "77755", "00700")
    assert same(GroupedByNetwork().join(PARTS, shown), PARTS)
    assert same(
        GroupedByNetwork(fragment=0.8).join(PARTS, shown), drawn("00000", "11133", "11133", "00100")
    )


def test_a_part_that_shows_no_instance_well_stays_alone():
    shown = drawn("00000", "55705", "50755", "00700")
    assert same(GroupedByNetwork(share=0.9).join(PARTS, shown), PARTS)


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        (("4444555", "4444555"), ("1111222", "1111222")),
        (("4444445", "4444445"), ("1111111", "1111111")),  # too small a share
        (("440055", "440055"), ("111222", "111222")),  # what shows none goes to the nearest
    ],
)
def test_a_part_of_several_instances_is_divided(rows, expected):
    shown = drawn(*rows, scale=6)
    objects = np.ones_like(shown)
    found = divide(objects, shown, 0.3, np.ones(objects.shape, np.float32))
    assert same(found, drawn(*expected, scale=6))


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
def test_two_boxes_that_a_network_takes_for_one(resolution):
    """And masks agree with volumes; other volumes come through."""
    grid = GridSpec(resolution=resolution)
    camera = camera_at(eye=(0.0, -0.85, 0.6))
    frame = frame_of(camera)
    inside = [
        np.all((grid.centres() > box.lower) & (grid.centres() < box.upper), axis=-1)
        for box in STACK
    ]
    one = torch.from_numpy((inside[0] | inside[1]).astype(np.int32))[None]
    volume = torch.zeros(1, 1, *grid.shape)
    partial = PartialTSDF(
        volume, volume > 0, torch.from_numpy(frame.depth)[None], stack_cameras([camera])
    )
    method = PartGuided(Fixed(grid, one), SeenParts(smallest=2000), GroupedByNetwork())
    assert method.metadata == {"made": "by hand"}
    (scene,) = method.complete(partial, grid, 1, torch.Generator())
    found = scene.instances[0].numpy()
    assert len(np.unique(found[found > 0])) == 2
    for box in inside:
        votes = np.bincount(found[box & (found > 0)])
        assert votes.max() > 0.65 * votes.sum()  # the nearest seen point is no more than a guess
    assert set(np.unique(scene.masks)) == {0, *np.unique(found[found > 0])}
    assert scene.volumes.keys() == {"mine"}
    parts = method.parts.segment(replace(frame, camera=camera))
    known = replace(partial, parts=torch.from_numpy(parts)[None])
    nobody = PartGuided(Fixed(grid, one), None, GroupedByNetwork())  # parts were found before
    (again,) = nobody.complete(known, grid, 1, torch.Generator())
    assert torch.equal(again.masks, scene.masks)
    with pytest.raises(InputError, match="depth images"):
        method.complete(PartialTSDF(volume, volume > 0), grid, 1, torch.Generator())


class FirstPart:
    """Finds the first of the parts that another finds."""

    def __init__(self, inner):
        self.inner = inner

    def segment(self, frame):
        parts = self.inner.segment(frame)
        return np.where(parts == 1, 1, 0).astype(np.int32)


@pytest.mark.parametrize("resolution", [32, 64])
def test_hulls_are_those_of_the_parts_alone(resolution):
    """What the parts leave to the floor isn't filled, though creases make a part of it."""
    grid, camera = GridSpec(resolution=resolution), camera_at(eye=(0.0, -0.85, 0.6))
    depth, volume = torch.from_numpy(frame_of(camera).depth)[None], torch.zeros(1, 1, *grid.shape)
    partial = PartialTSDF(volume + grid.truncation, volume > 0, depth, stack_cameras([camera]))
    parts = SeenParts(smallest=2000)
    (both,) = HullFilling(parts).complete(partial, grid, 1, torch.Generator())
    method = PartGuided(HullFilling(None), FirstPart(parts), GroupedByNetwork())
    (first,) = method.complete(partial, grid, 1, torch.Generator())
    assert len(both.instances.unique()) == 3
    assert len(first.instances.unique()) == 2
    assert torch.equal(first.instances.unique(), first.masks.unique())
    masks = parts.segment(replace(frame_of(camera), camera=camera))
    marked = replace(partial, masks=torch.from_numpy(masks)[None])
    (known,) = method.complete(marked, grid, 1, torch.Generator())
    assert torch.equal(known.instances.unique(), marked.masks.unique())


@pytest.mark.parametrize("wrong", [{"share": 1.5}, {"divided": -1}, {"border": 0}])
def test_wrong_numbers_are_refused(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        GroupedByNetwork(**wrong)


def test_a_reach_of_nothing_is_refused():
    with pytest.raises(ConfigError, match="reach is 0"):
        PartGuided(Fixed(GridSpec(resolution=32), None), SeenParts(), GroupedByNetwork(), reach=0)


def on_real_image(name, reconstructor):
    """The pipeline that a command builds, an image with hand-made labels, and what it shows."""
    beside = Path(__file__).parents[4] / ".." / "shared" / "data"
    folder = Path(os.environ.get("SCENEFW_DATA", beside)) / "real" / "mosd_learn"
    if not folder.is_dir():
        pytest.skip(f"no labelled real images at {folder} (set SCENEFW_DATA)")
    words = [f"reconstructor={reconstructor}", "run=predict", "input=x", "run.pipeline.samples=1"]
    pipeline = instantiate(config.compose([*words, "device=cpu"]).run.pipeline)
    frame = read_frame(folder / f"{name}.npz")
    return pipeline, frame, pipeline.estimate(frame)


@pytest.mark.parametrize(("name", "least"), [("learn00", 0.95), ("learn29", 0.95)])
def test_real_images(name, least):
    """The network alone joins two boxes on one, parts alone divide an object on the other."""
    pipeline, frame, estimate = on_real_image(name, "part_guided")
    assert mask_scores(estimate.masks, frame.labels).overlap_f > least
    pipeline.reconstructor = pipeline.reconstructor.inner
    plain = pipeline.estimate(frame).masks
    parts = SeenParts().segment(estimate.frame)
    assert min(mask_scores(found, frame.labels).overlap_f for found in (plain, parts)) < 0.8


def test_parts_of_a_real_image_are_joined_by_evidence():
    """Fine parts divide its objects; joined, they have the hand-made borders."""
    pipeline, frame, estimate = on_real_image("learn29", "by_evidence")
    assert mask_scores(estimate.masks, frame.labels).overlap_f > 0.95
    parts = pipeline.reconstructor.parts.segment(estimate.frame)
    assert mask_scores(parts, frame.labels).overlap_f < 0.85
