"""Superquadrics in place of rough volumes, and draws of them."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.unit.perception.completion.observed_boxes import observed
from tests.unit.perception.evidence.test_gathering import scene_of
from tests.unit.perception.usual_fits import TOLERANCES, object_fit

from scenefw.core.types import Pose
from scenefw.fitting.superquadrics import SuperquadricFit
from scenefw.perception.completion.superquadrics import FitSampling
from scenefw.perception.estimate.composition import composed, with_superquadrics
from scenefw.perception.evidence.gathering import EvidenceGathering
from scenefw.perception.evidence.object_fit import ObjectFit
from scenefw.perception.steps import Objects


def sampled(objects, view, samples=1, seed=0, tolerances=TOLERANCES, shape_fit=None, **settings):
    """Hypotheses of objects and a view."""
    fit = object_fit() if shape_fit is None else ObjectFit(shape_fit, EvidenceGathering(), 0.015)
    method = FitSampling(SuperquadricFit(), tolerances, **settings)
    generator = torch.Generator().manual_seed(seed)
    return method.complete(fit.fit(objects, view), view, samples, generator)


def half_of(objects, grid):
    """Objects whose volumes lack their hidden half."""
    behind = grid.centres()[..., 1] > 0.02
    tsdf = np.where(behind, np.float32(grid.truncation), objects.tsdf)
    return replace(objects, tsdf=tsdf, instances=np.where(behind, 0, objects.instances))


@pytest.mark.parametrize("resolution", [32, 64])
def test_boxes_come_out_sharp_and_whole(resolution):
    objects, geometry = scene_of(resolution)
    view, rough = observed(geometry), half_of(objects, geometry.grid)
    (hypothesis,) = sampled(rough, view)
    scene = composed(hypothesis, view)
    before, after, true = rough.tsdf < 0, scene.tsdf[0].numpy() < 0, objects.tsdf < 0
    overlap = [(solid & true).sum() / (solid | true).sum() for solid in (before, after)]
    assert overlap[1] > overlap[0] + 0.1
    found = scene.instances[0].numpy()
    assert set(np.unique(found)) == {0, 1, 2}
    assert ((found > 0) == after).all()
    np.testing.assert_array_equal(scene.masks[0].numpy(), objects.masks)
    assert set(scene.placed[0]) == {1, 2}
    for label, one in hypothesis.superquadrics.items():
        np.testing.assert_array_equal(scene.placed[0][label].shape.half_axes, one.half_axes)
        np.testing.assert_array_equal(scene.placed[0][label].pose.matrix, one.pose.matrix)


def test_draws_differ_in_what_is_hidden_and_agree_in_what_is_seen():
    objects, geometry = scene_of(48)
    flat = Objects(objects.masks)

    def volumes(count, seed=0):
        return [
            with_superquadrics(each.objects, each.superquadrics, geometry.grid)[0]
            for each in sampled(flat, geometry, count, seed)
        ]

    (best,), (first, *drawn) = volumes(1), volumes(6)
    np.testing.assert_array_equal(first, best)
    solid = np.stack([first, *drawn]) < 0
    differs = solid.any(axis=0) & ~solid.all(axis=0)
    assert differs.sum() > 50
    assert not (differs & geometry.free).any()
    np.testing.assert_array_equal(volumes(6)[3], drawn[2])
    assert not np.array_equal(volumes(6, seed=1)[3], drawn[2])


def test_without_draws_there_is_one_set_and_no_random_number():
    objects, geometry = scene_of(32)
    fits = object_fit().fit(objects, geometry)
    method = FitSampling(SuperquadricFit(), TOLERANCES, drawn=False)
    generator = torch.Generator()
    before = generator.get_state()
    (only,) = method.complete(fits, geometry, 3, generator)
    assert torch.equal(generator.get_state(), before)
    (best,) = sampled(objects, geometry)
    for label in (1, 2):
        mine, other = (each.superquadrics[label] for each in (only, best))
        np.testing.assert_array_equal(mine.half_axes, other.half_axes)


def test_what_no_superquadric_explains_stays_as_it_was():
    """An L: its visible points fit no convex shape."""
    objects, geometry = scene_of(32)
    whole = Objects(
        (objects.masks > 0).astype(np.int32), objects.tsdf, (objects.instances > 0).astype(np.int32)
    )
    strict = replace(TOLERANCES, inlier_distance=0.002, min_inlier_ratio=0.95)
    (hypothesis,) = sampled(whole, geometry, tolerances=strict)
    assert hypothesis.superquadrics == {}
    assert set(hypothesis.evidence) == {1}
    tsdf, instances = with_superquadrics(whole, hypothesis.superquadrics, geometry.grid)
    np.testing.assert_array_equal(instances, whole.instances)
    assert ((tsdf < 0) == (whole.tsdf < 0)).all()
    loose = replace(TOLERANCES, inlier_distance=0.1, max_free_ratio=1.0)
    assert set(sampled(whole, geometry, tolerances=loose)[0].superquadrics) == {1}


class Elongated(SuperquadricFit):
    """Fits that go on to the right, as a face that nobody sees may do."""

    def fit(self, evidence):
        return [
            replace(
                one,
                half_axes=one.half_axes + np.abs(one.pose.rotation.T @ RIGHT) * 0.1,
                pose=Pose(one.pose.position + 0.1 * RIGHT, one.pose.quaternion),
            )
            for one in super().fit(evidence)
        ]


RIGHT = np.array([1.0, 0.0, 0.0])


def test_a_fit_through_seen_free_space_is_not_taken():
    """Its distances say that it explains what is seen, but beside the object the floor is seen."""
    objects, geometry = scene_of(48)
    geometry = replace(geometry, free=np.abs(geometry.grid.centres()[..., 0]) > 0.12)
    assert set(sampled(objects, geometry)[0].superquadrics) == {1, 2}
    assert sampled(objects, geometry, shape_fit=Elongated())[0].superquadrics == {}
    blind = replace(geometry, free=np.zeros_like(geometry.free))
    assert sampled(objects, blind, shape_fit=Elongated())[0].superquadrics != {}
    tolerant = replace(TOLERANCES, max_free_ratio=1.0)
    shapes = sampled(objects, geometry, shape_fit=Elongated(), tolerances=tolerant)
    assert shapes[0].superquadrics != {}


def test_masks_alone_become_solid_objects():
    objects, geometry = scene_of(64)
    (hypothesis,) = sampled(Objects(objects.masks), geometry)
    assert set(hypothesis.superquadrics) == {1, 2}
    tsdf, instances = with_superquadrics(
        hypothesis.objects, hypothesis.superquadrics, geometry.grid
    )
    assert ((tsdf < 0) & (objects.tsdf < 0)).sum() > 0.6 * ((tsdf < 0) | (objects.tsdf < 0)).sum()
    assert set(np.unique(instances)) == {0, 1, 2}
