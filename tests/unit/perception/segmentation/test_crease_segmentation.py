"""Segmentation without learning: hand-made depth images, and the real ones where they are."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.unit.perception.synthetic import Box, camera_at, frame_of

from scenefw.core.errors import ConfigError
from scenefw.core.geometry import look_at, transform_points
from scenefw.core.types import Camera, Frame
from scenefw.data.files.readers import read_frames
from scenefw.perception.observation.floor import FloorFinder
from scenefw.perception.observation.observation import Observation
from scenefw.perception.segmentation.crease_segmentation import CreaseSegmentation
from scenefw_single_view_benchmarks.mask_scores import mask_scores

CAMERA = Camera(120, 90, 110.0, 110.0, 59.5, 44.5, look_at((0.0, -0.6, 0.8), (0.0, 0.0, 0.0)))


def _depth_of_slabs(slabs):
    """Ray-cast depth and labels of the floor and of slabs (x0, x1, y0, y1, height)."""
    v, u = np.indices((CAMERA.height, CAMERA.width))
    rays = np.stack(
        [(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones_like(u)], axis=-1
    )
    origin = CAMERA.T_world_camera[:3, 3]
    directions = transform_points(CAMERA.T_world_camera, rays) - origin
    depth = -origin[2] / directions[..., 2]  # rays have z = 1 in the camera: length = z-depth
    labels = np.zeros(depth.shape, np.int32)
    for label, (x0, x1, y0, y1, height) in enumerate(slabs, start=1):
        distance = (height - origin[2]) / directions[..., 2]
        x, y, _ = np.moveaxis(origin + directions * distance[..., None], -1, 0)
        hit = (x0 < x) & (x < x1) & (y0 < y) & (y < y1) & (distance < depth)
        depth[hit], labels[hit] = distance[hit], label
    return Frame(depth.astype(np.float32), CAMERA), labels


def test_separate_slabs_are_found_exactly():
    frame, labels = _depth_of_slabs([(-0.2, -0.05, -0.1, 0.1, 0.05), (0.05, 0.2, -0.1, 0.1, 0.1)])
    found = CreaseSegmentation(max_step=0.03, min_bend=180).segment(Observation(frame))
    assert mask_scores(found, labels).overlap_f == 1
    assert found.max() == 2


def test_depth_jump_cuts_what_touches_in_the_image():
    slabs = [(-0.1, 0.1, -0.1, 0.0, 0.15), (-0.1, 0.1, 0.0, 0.1, 0.05)]
    frame, labels = _depth_of_slabs(slabs)
    cut = CreaseSegmentation(max_step=0.04, min_bend=180).segment(Observation(frame))
    joined = CreaseSegmentation(max_step=1.0, min_bend=180).segment(Observation(frame))
    assert mask_scores(cut, labels).objects_f75 == 1
    assert joined.max() == 1


def test_specks_holes_and_empty_images_are_no_objects():
    frame, _ = _depth_of_slabs([(0.0, 0.02, 0.0, 0.02, 0.05)])
    assert CreaseSegmentation(min_pixels=5000).segment(Observation(frame)).max() == 0
    nothing = replace(frame, depth=np.zeros_like(frame.depth))
    assert CreaseSegmentation().segment(Observation(nothing)).max() == 0


def folded(angle, width, height):
    """Two planes that meet in a line at the middle of the image; angle > 0: towards the camera."""
    camera = Camera(width, height, 0.9 * width, 0.9 * width, (width - 1) / 2, (height - 1) / 2)
    slope = np.tan(np.radians(angle) / 2)
    x = np.abs(np.arange(width) - camera.cx) / camera.fx
    return Frame(np.tile(1 / (1 + slope * x), (height, 1)).astype(np.float32), camera)


@pytest.mark.parametrize("size", [(160, 120), (320, 240)])
def test_concave_creases_cut_and_belong_to_the_parts_beside_them(size):
    width, _ = size
    found = CreaseSegmentation().segment(Observation(folded(60, *size)))
    assert set(np.unique(found)) == {1, 2}  # no pixel is left out
    assert (found[:, : width // 2] == found[0, 0]).mean() > 0.95
    assert (found[:, width // 2 :] == found[0, -1]).mean() > 0.95
    assert found[0, 0] != found[0, -1]
    lines = CreaseSegmentation(grow=False).segment(Observation(folded(60, *size)))
    assert 0 < (lines == 0).mean() < 0.2
    assert (lines[lines > 0] == found[lines > 0]).all()
    assert CreaseSegmentation().segment(Observation(folded(-60, *size))).max() == 1
    assert CreaseSegmentation(min_bend=180).segment(Observation(folded(60, *size))).max() == 1


@pytest.mark.parametrize(
    "wrong",
    [{"floor_margin": -0.01}, {"max_step": 0}, {"min_bend": 0}, {"reach": 0}, {"min_pixels": 0}],
)
def test_wrong_numbers_are_refused(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        CreaseSegmentation(**wrong)


@pytest.mark.exhaustive
def test_near_the_figures_measured_elsewhere():
    """Overlap F 85.5, boundary F 72.6 are known for plane removal and components cut at jumps."""
    beside = Path(__file__).parents[4] / ".." / "shared" / "data"
    folder = Path(os.environ.get("SCENEFW_DATA", beside)) / "real" / "mosd_learn"
    if not folder.is_dir():
        pytest.skip(f"no labelled real images at {folder} (set SCENEFW_DATA)")
    method, floor = (
        CreaseSegmentation(floor_margin=0.01, max_step=0.02, min_bend=180, min_pixels=100),
        FloorFinder(),
    )
    scores = []
    for frame in read_frames(folder):
        pose = floor.find(frame).T_world_camera
        placed = replace(frame, camera=frame.camera.moved(pose))
        scores.append(mask_scores(method.segment(Observation(placed)), frame.labels))
    assert np.mean([s.overlap_f for s in scores]) == pytest.approx(0.855, abs=0.02)
    assert np.mean([s.boundary_f for s in scores]) == pytest.approx(0.726, abs=0.03)


def test_what_hardly_rises_above_the_floor_is_its_noise():
    flat, box = Box((-0.2, -0.1, 0.0), (-0.05, 0.0, 0.01)), Box((0.05, -0.1, 0.0), (0.2, 0.0, 0.1))
    camera = camera_at(eye=(0.0, -0.9, 0.5))
    frame = replace(frame_of(camera, (flat, box)), camera=camera)
    assert (
        CreaseSegmentation(floor_margin=0.003, min_pixels=100).segment(Observation(frame)).max()
        == 2
    )
    high = CreaseSegmentation(floor_margin=0.003, min_pixels=100, min_height=0.02).segment(
        Observation(frame)
    )
    assert high.max() == 1
    assert ((high > 0) & (frame.labels != 2)).sum() == 0
