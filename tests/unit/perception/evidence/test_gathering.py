"""What a view says about an object: boxes whose surfaces are known."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.perception.synthetic import STACK, camera_at, frame_of

from scenefw.core.errors import ConfigError
from scenefw.core.types import GridSpec
from scenefw.perception.evidence.gathering import EvidenceOfView, View
from scenefw.perception.observation.points import world_points


def view_of(resolution):
    """Two boxes on each other, seen from the front, with their true volumes."""
    grid, camera = GridSpec(resolution=resolution), camera_at(eye=(0.0, -0.85, 0.6))
    frame = frame_of(camera)
    points = world_points(type(frame)(frame.depth, camera))
    fields = np.stack([distance(grid.centres(), box) for box in STACK])
    tsdf = fields.min(axis=0).clip(-grid.truncation, grid.truncation).astype(np.float32)
    instances = np.where(tsdf < 0, fields.argmin(axis=0) + 1, 0).astype(np.int32)
    in_front = grid.centres()[..., 1] < -0.1
    return View(points, frame.labels, tsdf, instances, in_front, grid)


def distance(points, box):
    """Signed distance to a box, exact (Quilez)."""
    lower, upper = np.array(box.lower), np.array(box.upper)
    q = np.abs(points - (lower + upper) / 2) - (upper - lower) / 2
    return np.linalg.norm(q.clip(min=0), axis=-1) + q.max(axis=-1).clip(max=0)


@pytest.mark.parametrize("resolution", [32, 64])
@pytest.mark.parametrize("label", [1, 2])
def test_points_lie_on_the_object_and_places_outside_of_it(resolution, label):
    view, box = view_of(resolution), STACK[label - 1]
    gathered = EvidenceOfView(seen=100, hidden=80, outside=50)
    found = gathered.of(label, view)
    seen = found.sigmas == gathered.seen_sigma
    assert 0 < seen.sum() <= 100
    assert 0 < (~seen).sum() <= 80
    assert np.abs(distance(found.points[seen], box)).max() < 1e-5
    assert np.abs(distance(found.points[~seen], box)).max() < 1.5 * view.grid.voxel_size
    assert found.points[~seen, 1].mean() > found.points[seen, 1].mean() + 0.03  # it is behind
    assert distance(found.outside, box).min() > -1e-5
    assert (found.outside[:, 2] < 0).any()
    other = STACK[2 - label]
    assert (np.abs(distance(found.outside, other)) < 1e-5).any()
    assert (found.outside[:, 1] < -0.1).any()


def test_an_object_that_nobody_sees_has_only_hints():
    view = view_of(32)
    unseen = View(
        view.points, np.zeros_like(view.masks), view.tsdf, view.instances, view.free, view.grid
    )
    gathered = EvidenceOfView()
    assert (gathered.of(1, unseen).sigmas == gathered.hidden_sigma).all()
    assert len(gathered.of(7, view).points) == 0


@pytest.mark.parametrize("wrong", [{"seen_sigma": 0}, {"hidden": 0}, {"outside_sigma": -1}])
def test_wrong_numbers_are_refused(wrong):
    with pytest.raises(ConfigError, match=f"^{next(iter(wrong))} = "):
        EvidenceOfView(**wrong)


def test_what_is_seen_is_more_certain():
    with pytest.raises(ConfigError, match="more certain"):
        EvidenceOfView(seen_sigma=0.1)


@pytest.mark.parametrize("width", [320, 640])
def test_pixels_beside_another_object_are_left_out(width):
    """Columns of one object that the masks give to another, and of one that is thin."""
    height = width // 2
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    masks = np.zeros((height, width), np.int32)
    masks[40:80, 20:60], masks[40:80, 60:100], masks[100:140, 20:22] = 1, 2, 3
    masks[100:140, 22:60] = 4
    points = np.stack([x, y, np.ones_like(x)], axis=-1) * 1e-3
    empty = np.zeros((8, 8, 8), np.float32)
    view = View(points, masks, empty, empty.astype(np.int32), empty > 0, GridSpec(resolution=8))
    reach = 4 * width // 640
    own = EvidenceOfView(seen=10**6, border=4)
    columns = {k: np.rint(1e3 * own.of(k, view).points[:, 0]) for k in (1, 2, 3, 4)}
    assert columns[1].min() == 20  # nothing beside it there
    assert columns[1].max() == 59 - reach
    assert columns[2].min() == 60 + reach
    assert set(columns[3]) == {20, 21}  # thinner than the border
    assert columns[4].min() == 22 + reach
    everything = EvidenceOfView(seen=10**6)
    assert len(everything.of(1, view).points) == 1600


def test_a_negative_border_is_told():
    with pytest.raises(ConfigError, match="border = -1"):
        EvidenceOfView(border=-1)


def test_places_that_rays_pass_are_outside_if_the_camera_is_known():
    view, box = view_of(64), STACK[0]
    known = replace(view, eye=np.array([0.0, -0.85, 0.6]))
    gathered, plain = EvidenceOfView(beside=100), EvidenceOfView()
    before = len(plain.of(1, known).outside)
    assert len(gathered.of(1, view).outside) == before  # nobody knows where the camera is
    more = gathered.of(1, known).outside[before:]
    assert 50 < len(more) <= 100
    assert distance(more, box).min() > 0
    with pytest.raises(ConfigError, match="beside"):
        EvidenceOfView(beside=-1)
