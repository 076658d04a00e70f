"""Objects that somebody has marked come back, each under its id, or a line says why not."""

import re

import numpy as np
import pytest
from tests.unit.perception.pipelines import KnownBoxes, pipeline_of
from tests.unit.perception.synthetic import STACK, Box, camera_at, frame_of

from scenefw.core.errors import InputError
from scenefw.core.types import GridSpec
from scenefw.perception.estimate.marked_objects import called
from scenefw.perception.grouping.hulls import HullFilling
from scenefw.perception.segmentation.crease_segmentation import CreaseSegmentation

GRID = GridSpec(resolution=32)  # voxels of 3 cm
PHONE = Box((0.16, -0.2, 0.0), (0.23, -0.06, 0.008))
DICE = Box((-0.2, -0.2, 0.0), (-0.18, -0.18, 0.02))
FAR = Box((-0.9, 0.3, 0.0), (-0.8, 0.4, 0.1))
FRAME = frame_of(camera_at(eye=(0.0, -1.2, 0.8), size=(640, 480)), (*STACK, PHONE, DICE, FAR))
IDS = np.array([0, 7, 3, 40000, 12, 5], np.int32)


@pytest.fixture(scope="module")
def pipeline():
    return pipeline_of(
        segmentation=CreaseSegmentation(), grouping=HullFilling(), grid=GRID, samples=2
    )


def test_each_object_comes_back_under_its_id_even_if_voxels_are_coarser(pipeline):
    masks = np.where(FRAME.labels == 5, 0, IDS[FRAME.labels])
    view = pipeline.observe(FRAME, masks)
    assert not [line for line in view.warnings if "masks" in line]
    scenes = pipeline.reconstruct(view)
    for scene in scenes:
        assert [item.id for item in scene.objects] == [3, 7, 12, 40000]
        assert set(np.unique(scene.instances)) <= {0, 3, 7, 12, 40000}
        assert set(np.unique(scene.masks)) == {0, 3, 7, 12, 40000}
        for label in (7, 3, 40000, 12):
            assert ((scene.masks == label) & (masks == label)).sum() > 0.7 * (masks == label).sum()
    sizes = {item.id: np.sort(item.extents) for item in scenes[0].objects}
    np.testing.assert_allclose(sizes[40000], (0.008, 0.07, 0.14), atol=0.006)
    np.testing.assert_allclose(sizes[12], (0.02, 0.02, 0.02), atol=0.016)  # its diagonals


def test_pixels_of_the_floor_do_not_widen_what_stands(pipeline):
    columns = np.flatnonzero((FRAME.labels == 1).any(axis=0))
    masks = np.where(FRAME.labels == 1, 1, 0)
    masks[-100:, columns] = np.maximum(masks[-100:, columns], 1)  # more floor than object
    view = pipeline.observe(FRAME, masks)
    assert view.heights[view.masks > 0].min() > 0.01


@pytest.mark.parametrize(
    ("mark", "reason"),
    [
        (lambda masks, depth: depth.__setitem__(masks == 7, 0), "none of its .* usable depth"),
        (lambda masks, depth: masks.__setitem__((0, 0), 7), "outside the cube of 1 m"),
        (lambda masks, depth: depth.__setitem__(masks == 7, np.nan), "none of its"),
        (
            lambda masks, depth: masks.__setitem__((240, slice(318, 320)), 9),
            "its 2 pixels with depth are too few",
        ),
    ],
)
def test_why_an_object_is_left_out_is_told(pipeline, mark, reason):
    masks, depth = np.where(FRAME.labels == 2, 3, 0), FRAME.depth.copy()
    masks[FRAME.labels == 1] = 7
    if "outside" in reason:
        masks[masks == 7] = 0
    mark(masks, depth)
    lost = 9 if 9 in masks else 7
    view = pipeline.observe(type(FRAME)(depth, FRAME.camera, name="image"), masks)
    assert lost not in view.ids
    (line,) = (line for line in view.warnings if "left out" in line and "masks" in line)
    assert line.startswith(f"object {lost} of the masks is left out: ")
    assert re.search(reason, line)
    assert 3 in [item.id for item in pipeline.reconstruct(view, first_only=True)[0].objects]


def test_an_object_in_two_pieces_is_one(pipeline):
    box = (Box((-0.2, -0.08, 0.0), (0.2, 0.08, 0.12)),)
    frame = frame_of(camera_at(eye=(0.0, -0.85, 0.6)), box)
    masks = np.where(frame.labels > 0, 4, 0)
    masks[:, 130:190] = np.where(masks[:, 130:190] > 0, 2, 0)  # in its middle
    (scene, _) = pipeline(frame, masks)
    assert [item.id for item in scene.objects] == [2, 4]


def test_ids_that_no_picture_of_16_bits_holds_are_refused(pipeline):
    with pytest.raises(InputError, match="ids of 1 to 65535"):
        pipeline.observe(FRAME, np.where(FRAME.labels == 1, 70000, 0))


def test_who_ignores_ids_says_so():
    pipeline = pipeline_of(KnownBoxes(GRID), grid=GRID)
    view = pipeline.observe(FRAME, IDS[FRAME.labels])
    assert [line for line in view.warnings if "which is which" in line]
    assert not [
        line
        for line in pipeline.observe(FRAME, FRAME.labels > 0).warnings
        if "which is which" in line
    ]


def test_objects_without_an_id_get_the_next_ones(pipeline):
    scene = pipeline(FRAME, np.where(FRAME.labels == 1, 1, np.where(FRAME.labels == 2, 2, 0)))[0]
    assert [item.id for item in called(scene, [9]).objects] == [9, 10]
    assert called(scene, ()) is scene
