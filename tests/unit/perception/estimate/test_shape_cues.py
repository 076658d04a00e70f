"""Cues about boxes of which a view is known, and the confidence that they justify."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.perception.estimate.test_plausibility import BOX, OTHER, solid
from tests.unit.perception.synthetic import camera_at, frame_of

from scenefw.core.types import GridSpec, SceneEstimate
from scenefw.perception.estimate.assembly import with_confidence
from scenefw.perception.estimate.objects import estimate_objects
from scenefw.perception.estimate.shape_cues import CUES, shape_cues
from scenefw.perception.evidence.mesh_distances import mesh_volumes
from scenefw.perception.observation.observation import Observation
from scenefw.postprocessing.confidence import ExpectedOverlap

RIGHT = (BOX.lower, BOX.upper)
WRONG = {
    "far too large": ((-0.15, -0.05, 0.0), (0.15, 0.25, 0.22)),
    "before what was measured": ((-0.05, -0.2, 0.0), (0.05, 0.05, 0.12)),
    "a slice of it": ((-0.05, -0.05, 0.0), (0.05, -0.04, 0.12)),
    "beside it": ((-0.13, -0.05, 0.0), (-0.03, 0.05, 0.12)),
}


def seen(corners):
    """An estimate with a box in place of the first one, and the view of the true ones."""
    camera = camera_at(eye=(0.1, -0.8, 0.6), size=(320, 240))
    frame = replace(frame_of(camera, (BOX, OTHER)), camera=camera)
    meshes = {1: solid(*corners), 2: solid(OTHER.lower, OTHER.upper)}
    grid = GridSpec(resolution=32)
    tsdf, instances = mesh_volumes(list(meshes.items()), grid)
    objects = estimate_objects(meshes, {})
    estimate = SceneEstimate(objects, grid, tsdf, instances, frame, masks=frame.labels)
    return estimate, Observation(frame)


def cues_of(corners, agreement=1.0):
    return shape_cues(*seen(corners), {1: agreement, 2: 1.0})[1]


def test_a_right_shape_agrees_with_its_view():
    cues = cues_of(RIGHT)
    assert set(cues) == set(CUES)
    assert cues["silhouette"] > 0.97
    assert cues["residual"] < 0.2
    assert cues["free"] < 0.2
    assert cues["occluded"] < 0.02
    assert cues["fill"] == pytest.approx(1.0)
    assert cues["hull"] == 1.0  # nobody has said that it is a box
    volume, area = 0.1 * 0.1 * 0.12, 2 * (0.01 + 2 * 0.012)
    assert cues["thickness"] == pytest.approx(np.log(volume / area))


@pytest.mark.parametrize(
    ("name", "cue", "sign"),
    [
        ("far too large", "silhouette", -1), ("far too large", "free", 1),
        ("before what was measured", "free", 1),
        ("before what was measured", "residual", 1), ("beside it", "silhouette", -1),
    ],
)  # fmt: skip
def test_a_wrong_shape_shows_in_a_cue(name, cue, sign):
    right, wrong = cues_of(RIGHT)[cue], cues_of(WRONG[name])[cue]
    assert sign * (wrong - right) > 0.1


def confidence_of(corners, agreement=1.0):
    estimate, view = seen(corners)
    shipped = ExpectedOverlap.shipped("set_extents")
    first, second = with_confidence(estimate, view, {1: agreement}, shipped).objects
    assert second.cues["agreement"] == 1.0  # without voxels it is the same in all hypotheses
    return first.confidence


@pytest.mark.parametrize("name", ["far too large", "before what was measured", "beside it"])
def test_worse_shapes_have_less_confidence(name):
    assert confidence_of(WRONG[name]) < confidence_of(RIGHT) - 0.05


def test_confidence_rises_with_agreement():
    low, middle, high = (confidence_of(RIGHT, agreement) for agreement in (0.2, 0.6, 1.0))
    assert low <= middle <= high
    assert low < high


def test_objects_that_nobody_sees_have_cues_too():
    estimate, view = seen(RIGHT)
    unseen = replace(estimate, masks=np.zeros_like(estimate.masks))
    for cues in shape_cues(unseen, view, {}).values():
        assert np.isfinite(list(cues.values())).all()
    behind = estimate_objects({1: solid((-0.1, -1.2, 0.5), (0.1, -1.0, 0.7))}, {})
    (cues,) = shape_cues(replace(unseen, objects=behind), view, {}).values()
    assert np.isfinite(list(cues.values())).all()
    assert cues["silhouette"] == 0.0
