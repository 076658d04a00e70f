from dataclasses import replace

import numpy as np
import pytest
from tests.unit.perception.pipelines import KnownBoxes, pipeline_of
from tests.unit.perception.synthetic import STACK, camera_at, frame_of

from scenefw.core.geometry import rotation_from_quaternion
from scenefw.core.types import GridSpec
from scenefw_viewer import layers

GRID = GridSpec(resolution=32)
CAMERA = camera_at(eye=(0.0, -0.85, 0.6), size=(160, 120))


@pytest.fixture(scope="module")
def known():
    pipeline = pipeline_of(KnownBoxes(GRID), samples=1)
    view = pipeline.observe(frame_of(CAMERA))
    partial = view.partial.distance[0, 0].numpy()
    return layers.Prediction(tuple(pipeline.reconstruct(view)), view.source, partial)


def test_points_lie_on_floor_and_boxes(known):
    points, colours = layers.cloud(known)
    assert points.shape == colours.shape == (len(points), 3)
    assert len(points) > 5000
    on_floor = np.abs(points[:, 2]) < 0.005
    assert 0.3 < on_floor.mean() < 0.95
    assert abs(points[:, 2].max() - STACK[1].upper[2]) < 0.01


def test_points_have_the_colours_of_the_image(known):
    colour = np.zeros((120, 160, 3), np.uint8)
    colour[known.frame.labels == 2] = (200, 10, 30)
    points, colours = layers.cloud(replace(known, frame=replace(known.frame, colour=colour)))
    upper = points[:, 2] > STACK[1].lower[2] + 0.01
    assert (colours[upper] == (200, 10, 30)).all()
    assert (colours[points[:, 2] < 0.01] == 0).all()


def test_truth_is_the_labelled_points(known):
    points, colours = layers.truth(known)
    assert points[:, 2].min() > -0.005
    assert len(points) == (known.frame.labels > 0).sum()
    assert len(np.unique(colours, axis=0)) == 2
    assert layers.truth(replace(known, frame=replace(known.frame, labels=None))) is None


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_pixels_of_a_slice_lie_where_their_voxels_are(axis):
    """A ball off the middle: the bluest pixel, put on the plane, is its centre."""
    centre = np.array([0.2, -0.1, 0.3])
    distance = np.linalg.norm(GRID.centres() - centre, axis=-1) - 0.1
    distance = distance.clip(-GRID.truncation, GRID.truncation).astype(np.float32)
    part = layers.slice_volume(distance, GRID, axis, centre[axis])
    free = part.picture[..., 0] >= part.picture[..., 2]
    row, column = np.argwhere(~free).mean(axis=0)
    local = np.array([(column + 0.5) / 32 - 0.5, (row + 0.5) / 32 - 0.5, 0]) * part.size
    place = rotation_from_quaternion(part.quaternion) @ local + part.position
    np.testing.assert_allclose(place, centre, atol=GRID.voxel_size)


def test_captions_name_volumes(known):
    low, high = np.array(STACK[0].lower), np.array(STACK[0].upper)
    litres = 1000 * np.prod(high - low)
    text = layers.caption(known.scenes[0].objects[0])
    assert text.startswith("1: ")
    assert abs(float(text.split()[1]) - litres) < 0.25 * litres


def test_one_starts_on_the_cameras_side_above_the_floor(known):
    eye, middle = layers.start(known.scenes[0])
    camera = known.scenes[0].frame.camera.T_world_camera[:3, 3]
    assert (eye - middle)[:2] @ (camera - middle)[:2] > 0
    assert eye[2] > middle[2] > 0
    empty = replace(known.scenes[0], objects=())
    assert np.isfinite(layers.start(empty)).all()
