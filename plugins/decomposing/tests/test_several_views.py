"""Methods on several views: joined parts, fits to all views, codes that explain them."""

import numpy as np
import pytest
import torch
from plugins.decomposing.tests.several import views_fit
from tests.unit.mapping.test_several_views import BACK, FRONT, GRID, box_at, seen

from scenefw.core.batches import SceneParameters
from scenefw.core.errors import ConfigError
from scenefw.fitting.superquadrics import SuperquadricFit
from scenefw.metrics.occupancy import occupancy_iou
from scenefw.perception.cached import Cached
from scenefw.perception.evidence.gathering import EvidenceGathering
from scenefw.perception.grouping.merging import FitMerging
from scenefw.perception.grouping.segment_fits import SegmentFits
from scenefw.perception.observation.observation import Observation
from scenefw.perception.observation.views import Views
from scenefw.perception.steps import Objects
from scenefw.representations.volumes import scene_volumes
from scenefw_decomposing.reassignment import ResidualReassignment
from scenefw_decomposing.views_grouping import ViewsGrouping, _refined
from scenefw_decomposing.views_segmentation import ViewsSegmentation

NOISE = torch.Generator()


class Foreground:
    """One segment of each view: all that is above the floor, the half of a box that faces it."""

    def __init__(self):
        self.calls = 0

    def segment(self, view):
        self.calls += 1
        return (view.heights > 0.01).astype(np.int32)


class NearestBoxes:
    """Segments of a scene's boxes, by which of them a visible point is nearest to."""

    def __init__(self, scene):
        self.places = scene.positions[0].numpy()

    def segment(self, view):
        distances = np.linalg.norm(view.points[..., None, :] - self.places, axis=-1)
        return np.where(view.heights > 0.01, distances.argmin(axis=-1) + 1, 0).astype(np.int32)


class SegmentsAsObjects:
    """Each segment is an object; in views from `blind` (a place along y) all are one."""

    grid = GRID

    def __init__(self, blind=None):
        self.blind, self.calls = blind, 0

    def group(self, segments, view):
        self.calls += 1
        is_blind = self.blind is not None and view.eye[1] * self.blind > 0
        return Objects(np.minimum(segments, 1) if is_blind else segments)


class NoReassignment:
    """Leaves all pixels at the objects that they are of."""

    def reassign(self, objects, view):
        return objects


def two_boxes():
    """A tall box and a flat one side by side along x."""
    one, half_axes = box_at(0.0), torch.tensor([[[0.08, 0.08, 0.12], [0.1, 0.08, 0.04]]])
    places = torch.tensor([[[-0.12, 0.0, 0.12], [0.12, 0.0, 0.04]]])
    return SceneParameters(
        half_axes, one.exponents.expand(1, 2, 3) * 3, one.rotations.expand(1, 2, 3, 3), places,
        one.present.expand(1, 2),
    )  # fmt: skip


def fits():
    return SegmentFits(SuperquadricFit(), EvidenceGathering())


def views_grouping(reassign=None):
    """Merges objects by evidence and then deals pixels out by fit unless told otherwise."""
    reassign = ResidualReassignment(fits()) if reassign is None else reassign
    return ViewsGrouping(FitMerging(fits()), reassign)


def objects_of(segmentation, grouping, views, reassign=None):
    """Objects that partial TSDFs show together."""
    together = Views.of_partials(views, GRID)
    segments = ViewsSegmentation(segmentation, grouping).segment(together)
    return views_grouping(reassign).group(segments, together)


def points_of(view):
    """World coordinates (H, W, 3) of the pixels of a partial TSDF."""
    return Observation.of_partial(view, GRID).points


def test_halves_seen_from_two_sides_are_one_object_and_fitted_whole():
    views, segmentation, grouping = (
        seen(box_at(0.0), FRONT, BACK),
        Foreground(),
        SegmentsAsObjects(),
    )
    steps = Cached(segmentation), Cached(grouping)
    objects = objects_of(*steps, views)
    assert np.unique(objects.instances).tolist() == [0, 1]
    assert np.unique(objects.masks).tolist() == [0, 1]
    assert objects.masks.shape == (120, 80)
    objects_of(*steps, views[:1])
    method = views_fit(*steps, views_grouping(), fit=SuperquadricFit())
    (sharp,) = method.complete_views(views, GRID, 1, NOISE)
    assert (segmentation.calls, grouping.calls) == (2, 2)  # each view once
    assert list(sharp.placed[0]) == [1]  # a superquadric in place of the hull
    truth = scene_volumes(box_at(0.0), GRID).tsdf[0, 0].numpy() < 0
    assert occupancy_iou(sharp.tsdf[0].numpy() < 0, truth) > 0.9
    assert occupancy_iou(objects.tsdf < 0, truth) > 0.9  # the hull of both halves


def test_boxes_side_by_side_stay_two():
    scene = two_boxes()
    views = seen(scene, (0.0, 0.9, 0.5), (0.0, -0.9, 0.5))
    found = objects_of(NearestBoxes(scene), SegmentsAsObjects(), views)
    assert np.unique(found.masks).tolist() == [0, 1, 2]
    for mask, view in zip(np.split(found.masks, 2), views, strict=True):
        points = points_of(view)
        left = mask[points[..., 0] < -0.03]
        right = mask[(points[..., 0] > 0.03) & (points[..., 2] > 0.01)]
        assert np.unique(left[left > 0]).tolist() != np.unique(right).tolist()
    assert np.bincount(found.instances.ravel())[1:].min() > 50


def test_a_view_that_takes_two_for_one_is_overruled_by_those_that_know_better():
    scene = two_boxes()
    eyes = (0.5, 0.7, 0.6), (-0.5, 0.7, 0.6), (0.0, 0.9, 0.3), (0.0, -0.8, 0.6)
    views, steps = seen(scene, *eyes), (NearestBoxes(scene), SegmentsAsObjects(blind=-1))
    before = objects_of(*steps, views, NoReassignment())
    assert before.masks.max() > 2
    found = objects_of(*steps, views)
    assert found.masks.max() == 2
    last = np.split(found.masks, len(eyes))[-1]
    points = points_of(views[-1])
    high = points[..., 2] > 0.01
    sides = [np.bincount(last[high & (s * points[..., 0] > 0.03)], minlength=3) for s in (1, -1)]
    assert {int(one.argmax()) for one in sides} == {1, 2}
    assert all(one.max() > 0.95 * one.sum() for one in sides)


def test_objects_that_no_grouping_knows_keep_their_number():
    """Parts too small for the coarse image, and parts that were cut."""
    parts = np.zeros((8, 8), np.int32)
    parts[:, :4], parts[1, 7] = 1, 2
    few = parts[::2, ::2]
    cut = few.copy()
    cut[2:, :2] = 5
    found = _refined(cut, few, parts, 2)
    assert found[0, 0] == 1
    assert found[7, 3] == 5
    assert (found[:, :4] > 0).all()
    assert found[1, 7] not in (0, 1, 5)
    assert (found[:, 4:7] == 0).all()


def test_ratios_are_checked():
    with pytest.raises(ConfigError, match="share above 0"):
        ResidualReassignment(fits(), min_explained_ratio=0)
