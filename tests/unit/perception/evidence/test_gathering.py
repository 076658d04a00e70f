"""What a view says about an object: boxes whose surfaces are known."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.perception.synthetic import STACK, camera_at, frame_of

from scenefw.core.errors import ConfigError
from scenefw.core.types import GridSpec
from scenefw.perception.evidence.gathering import EvidenceGathering
from scenefw.perception.observation.observation import JointGeometry
from scenefw.perception.observation.points import world_points
from scenefw.perception.steps import Objects


def scene_of(resolution):
    """Two boxes on each other with their true volumes, and what a view from the front says."""
    grid, camera = GridSpec(resolution=resolution), camera_at(eye=(0.0, -0.85, 0.6))
    frame = frame_of(camera)
    points = world_points(type(frame)(frame.depth, camera))
    fields = np.stack([distance(grid.centres(), box) for box in STACK])
    tsdf = fields.min(axis=0).clip(-grid.truncation, grid.truncation).astype(np.float32)
    instances = np.where(tsdf < 0, fields.argmin(axis=0) + 1, 0).astype(np.int32)
    in_front = grid.centres()[..., 1] < -0.1
    objects = Objects(frame.labels, tsdf, instances)
    return objects, JointGeometry(points, grid, in_front)


def distance(points, box):
    """Signed distance to a box, exact (Quilez)."""
    lower, upper = np.array(box.lower), np.array(box.upper)
    q = np.abs(points - (lower + upper) / 2) - (upper - lower) / 2
    return np.linalg.norm(q.clip(min=0), axis=-1) + q.max(axis=-1).clip(max=0)


@pytest.mark.parametrize("resolution", [32, 64])
@pytest.mark.parametrize("label", [1, 2])
def test_points_lie_on_the_object_and_places_outside_of_it(resolution, label):
    (objects, geometry), box = scene_of(resolution), STACK[label - 1]
    gathered = EvidenceGathering(surface_points=100, outside_points=50)
    found = gathered.of(label, objects, geometry)
    seen = found.sigmas == gathered.visible_sigma
    assert 0 < seen.sum() <= 100
    assert 0 < (~seen).sum() <= 100
    assert np.abs(distance(found.points[seen], box)).max() < 1e-5
    assert np.abs(distance(found.points[~seen], box)).max() < 1.5 * geometry.grid.voxel_size
    assert found.points[~seen, 1].mean() > found.points[seen, 1].mean() + 0.03  # it is behind
    assert distance(found.outside, box).min() > -1e-5
    assert (found.outside[:, 2] < 0).any()
    other = STACK[2 - label]
    assert (np.abs(distance(found.outside, other)) < 1e-5).any()
    assert (found.outside[:, 1] < -0.1).any()


@pytest.mark.parametrize("resolution", [32, 64])
def test_of_several_objects_each_has_the_evidence_that_it_has_alone(resolution):
    """In whatever order they are asked for, an object that isn't there among them."""
    objects, geometry = scene_of(resolution)
    gathered = EvidenceGathering(border_pixels=4, passing_points=50)
    known = replace(geometry, eye=np.array([0.0, -0.85, 0.6]))
    labels = (2, 9, 1)
    each = gathered.of_each([[label] for label in labels], objects, known)
    for label, found in zip(labels, each, strict=True):
        alone = gathered.of(label, objects, known)
        for name in ("points", "sigmas", "outside", "outside_sigmas"):
            np.testing.assert_array_equal(getattr(found, name), getattr(alone, name))
        assert bool(len(found.points)) == (label < 9)


@pytest.mark.parametrize("resolution", [32, 64])
def test_labels_taken_together_have_the_evidence_of_one_object(resolution):
    objects, geometry = scene_of(resolution)
    merged = replace(objects, masks=np.where(objects.masks == 2, 1, objects.masks))
    gathered = EvidenceGathering(border_pixels=4)
    (together,) = gathered.of_each([(2, 1)], objects, geometry)
    alone = gathered.of(1, merged, geometry)
    for name in ("points", "sigmas", "outside", "outside_sigmas"):
        np.testing.assert_array_equal(getattr(together, name), getattr(alone, name))


def test_an_object_that_nobody_sees_has_only_hints():
    objects, geometry = scene_of(32)
    unseen = replace(objects, masks=np.zeros_like(objects.masks))
    gathered = EvidenceGathering()
    hints = gathered.of(1, unseen, geometry)
    assert len(hints.points) > 0
    assert (hints.sigmas == gathered.hidden_sigma).all()
    assert len(gathered.of(7, objects, geometry).points) == 0


def test_an_object_without_a_volume_has_no_hints():
    objects, geometry = scene_of(32)
    gathered = EvidenceGathering()
    flat = gathered.of(1, Objects(objects.masks), geometry)
    assert len(flat.points) > 0
    assert (flat.sigmas == gathered.visible_sigma).all()


@pytest.mark.parametrize(
    "wrong", [{"visible_sigma": 0}, {"surface_points": 0}, {"outside_sigma": -1}]
)
def test_wrong_numbers_are_refused(wrong):
    with pytest.raises(ConfigError, match=f"^{next(iter(wrong))} = "):
        EvidenceGathering(**wrong)


def test_what_is_seen_is_more_certain():
    with pytest.raises(ConfigError, match="more certain"):
        EvidenceGathering(visible_sigma=0.1, hidden_sigma=0.05)


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
    objects = Objects(masks, empty, empty.astype(np.int32))
    geometry = JointGeometry(points, GridSpec(resolution=8), empty > 0)
    reach = 4 * width // 640
    own = EvidenceGathering(surface_points=10**6, border_pixels=4)
    found = {k: own.of(k, objects, geometry).points for k in (1, 2, 3, 4)}
    columns = {k: np.rint(1e3 * points[:, 0]) for k, points in found.items()}
    assert columns[1].min() == 20  # nothing beside it there
    assert columns[1].max() == 59 - reach
    assert columns[2].min() == 60 + reach
    assert set(columns[3]) == {20, 21}  # thinner than the border
    assert columns[4].min() == 22 + reach
    for segments in (own.of_segments, EvidenceGathering(surface_points=10**6, border_pixels=0)):
        assert len(segments.of(1, objects, geometry).points) == 1600


def test_a_negative_border_is_told():
    with pytest.raises(ConfigError, match="border_pixels = -1"):
        EvidenceGathering(border_pixels=-1)


def test_places_that_rays_pass_are_outside_if_the_camera_is_known():
    (objects, geometry), box = scene_of(64), STACK[0]
    known = replace(geometry, eye=np.array([0.0, -0.85, 0.6]))
    gathered, plain = (EvidenceGathering(passing_points=n) for n in (100, 0))
    before = len(plain.of(1, objects, known).outside)
    blind = gathered.of(1, objects, geometry)  # nobody knows where the camera is
    assert len(blind.outside) == before
    assert len(gathered.of_segments.of(1, objects, known).outside) == before
    more = gathered.of(1, objects, known).outside[before:]
    assert 50 < len(more) <= 100
    assert distance(more, box).min() > 0
    with pytest.raises(ConfigError, match="passing_points"):
        EvidenceGathering(passing_points=-1)
