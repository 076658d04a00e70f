"""Scenes that a decoder of sets predicts, as they are and fitted to the image."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
import torch
from tests.unit.perception.completion.observed_boxes import observed, partial_of
from tests.unit.perception.evidence.test_gathering import distance, scene_of
from tests.unit.perception.synthetic import STACK, camera_at

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.queried_sets import QueriedSet
from scenefw.core.types import GridSpec
from scenefw.data.batches.set_inputs import image_view
from scenefw.data.batches.view_samples import image_facts, view_facts
from scenefw.fitting.joint import JointFit
from scenefw.fitting.superquadrics import SuperquadricFit
from scenefw.perception.completion.object_queries import ObjectQuerySampling
from scenefw.perception.completion.refinement import SetRefinement
from scenefw.perception.estimate.composition import composed
from scenefw.perception.evidence.gathering import EvidenceGathering
from scenefw.perception.observation.observation import Observation
from scenefw.perception.steps import Fits, Objects

BOXES = [(np.array(box.lower), np.array(box.upper)) for box in STACK]
ROUGH = [(lower + 0.012, upper + 0.012) for lower, upper in BOXES]
HIDDEN = (np.array([-0.02, 0.1, 0.0]), np.array([0.02, 0.14, 0.03]))
IN_SIGHT = (np.array([-0.02, -0.3, 0.1]), np.array([0.02, -0.26, 0.14]))


class Told(torch.nn.Module):
    """Predicts boxes (lower, upper), of which the last is not there."""

    sees = "volume"

    def __init__(self, boxes):
        super().__init__()
        self.any = torch.nn.Parameter(torch.zeros(1))
        ends = torch.from_numpy(np.array([*boxes, BOXES[0]])).float()[None]
        count = ends.shape[1]
        existence = torch.linspace(4, 2, count)[None].clone()
        existence[:, -1] = -3.0
        self.found = QueriedSet(
            existence, (ends[:, :, 1] - ends[:, :, 0]) / 2, torch.full((1, count, 3), 60.0),
            torch.eye(3).expand(1, count, 3, 3), ends.mean(dim=2),
            torch.ones(1, count, dtype=torch.bool), ends.mean(dim=2),
        )  # fmt: skip

    def predict(self, condition, points, seen):
        self.saw = condition, points, seen
        return self.found


class ToldOfImages(Told):
    """The same boxes, in the frame of the view that it was shown."""

    sees = "image"

    def __init__(self, boxes, view):
        super().__init__(boxes)
        shift = self.found.positions - view.origin[:, None]
        self.found = replace(
            self.found, rotations=view.turn[:, None] @ self.found.rotations,
            positions=torch.einsum("bij,bnj->bni", view.turn, shift),
        )  # fmt: skip


@dataclass
class Loaded:
    model: Told
    grid: GridSpec
    metadata: dict = field(default_factory=lambda: {"made": "by hand"})


NO_FITS = Fits(Objects(None))


def complete(boxes, *, fitted=False, resolution=48):
    """The true objects, the network, and the scene that it gives."""
    objects, geometry = scene_of(resolution)
    model = Told(boxes)
    refined = SetRefinement(JointFit(SuperquadricFit()), EvidenceGathering()) if fitted else None
    method = ObjectQuerySampling(Loaded(model, geometry.grid), refined)
    assert method.metadata == {"made": "by hand"}
    view = observed(geometry)
    first, second = method.complete(NO_FITS, view, 2, torch.Generator())
    assert second is first
    return objects, model, composed(first, view)


@pytest.mark.parametrize(("metadata", "points"), [({}, 1024), (view_facts(50), 50)])
def test_networks_are_shown_as_many_points_as_in_their_training(metadata, points):
    _, geometry = scene_of(48)
    method = ObjectQuerySampling(Loaded(Told(BOXES), geometry.grid, metadata))
    method.complete(NO_FITS, observed(geometry), 1, torch.Generator())
    assert method.queried.model.saw[1].shape == (1, points, 3)


def overlap(scene, objects):
    found, true = scene.tsdf[0].numpy() < 0, objects.tsdf < 0
    return (found & true).sum() / (found | true).sum()


def test_what_is_predicted_becomes_a_scene():
    objects, model, scene = complete(BOXES)
    assert overlap(scene, objects) > 0.95
    assert set(np.unique(scene.instances.numpy())) == {0, 1, 2}
    assert list(scene.placed[0]) == [1, 2]
    shown = scene.masks[0].numpy()
    both = (objects.masks > 0) & (shown > 0)
    assert (shown[both] == objects.masks[both]).mean() > 0.98
    assert both.sum() > 0.97 * (objects.masks > 0).sum()
    _, points, seen = model.saw
    assert seen.all()
    gaps = np.min([np.abs(distance(points[0].numpy(), box)) for box in STACK], axis=0)
    assert np.quantile(gaps, 0.95) < 2e-3


@pytest.mark.parametrize("eye", [(0.0, -0.85, 0.6), (0.7, 0.4, 0.5)])
@pytest.mark.parametrize("width", [64, 128])
def test_what_is_predicted_in_the_frame_of_an_image_stands_in_the_world(eye, width):
    objects, geometry = scene_of(48)
    nothing = replace(geometry, free=np.zeros_like(geometry.free))  # another side is free from here
    view = observed(nothing, camera_at(eye=eye))
    seen = image_view(view.partial, view.grid, width)
    assert abs(seen.turn[0, 0, 1]) > 0.1  # not the world's x
    model = ToldOfImages(BOXES, seen)
    method = ObjectQuerySampling(Loaded(model, view.grid, image_facts(width)))
    (hypothesis,) = method.complete(NO_FITS, view, 1, torch.Generator())
    assert overlap(composed(hypothesis, view), objects) > 0.95
    condition, points, _ = model.saw
    assert condition.shape[-1] == width
    assert torch.equal(points, seen.points)


def test_rough_predictions_are_fitted_to_what_is_seen():
    objects, _, rough = complete(ROUGH)
    _, _, fitted = complete(ROUGH, fitted=True)
    assert overlap(fitted, objects) > overlap(rough, objects) + 0.1
    assert overlap(fitted, objects) > 0.9


def test_of_predictions_of_one_object_the_surer_is_kept():
    _, _, scene = complete([BOXES[0], ROUGH[0], BOXES[1]])
    assert len(scene.placed[0]) == 2


def test_hidden_objects_stay_where_nothing_speaks_against_them():
    _, _, scene = complete([*BOXES, HIDDEN], fitted=True)
    assert len(scene.placed[0]) == 3
    _, _, scene = complete([*BOXES, IN_SIGHT], fitted=True)
    assert len(scene.placed[0]) == 2


def test_a_view_without_objects_is_empty():
    for fitted in (False, True):
        _, _, scene = complete([], fitted=fitted)
        assert (scene.instances == 0).all()
        assert (scene.tsdf > 0).all()
        assert (scene.masks == 0).all()
        assert scene.placed == ({},)


def test_what_it_cannot_do_is_said_in_one_line():
    _, geometry = scene_of(32)
    loaded = Loaded(Told(BOXES), geometry.grid)
    blind = Observation.of_partial(replace(partial_of(geometry), depth=None), geometry.grid)
    with pytest.raises(InputError, match="needs the depth images"):
        ObjectQuerySampling(loaded).complete(NO_FITS, blind, 1, torch.Generator())
    for wrong, words in (
        ({"min_existence": 1.5}, r"min_existence = 1\.5"),
        ({"max_distance": 0.0}, r"max_distance = 0\.0"),
    ):
        with pytest.raises(ConfigError, match=words):
            ObjectQuerySampling(loaded, **wrong)
    with pytest.raises(ConfigError, match=r"pseudo_sigma = 0\.001"):
        SetRefinement(JointFit(SuperquadricFit()), EvidenceGathering(), pseudo_sigma=0.001)
