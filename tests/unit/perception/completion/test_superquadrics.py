"""Superquadrics in place of predicted objects, and objects that stay as they are."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.unit.perception.evidence.test_gathering import distance, view_of
from tests.unit.perception.synthetic import STACK, camera_at, frame_of

from scenefw.core.batches import Completion, PartialTSDF
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.types import Pose
from scenefw.fitting.superquadrics import SuperquadricFit
from scenefw.kernels.cameras import stack_cameras
from scenefw.perception.completion.superquadrics import Fitted, composed, each_drawn
from scenefw.perception.evidence.gathering import EvidenceOfView, View


class Rough:
    """Predicts the boxes of a view with their hidden half missing."""

    def __init__(self, view):
        self.grid, self.metadata = view.grid, {"made": "by hand"}
        behind = view.grid.centres()[..., 1] > 0.02
        tsdf = np.where(behind, view.grid.truncation, view.tsdf)
        self.scene = Completion(
            torch.from_numpy(tsdf)[None].float(),
            torch.from_numpy(np.where(behind, 0, view.instances))[None].int(),
            masks=torch.from_numpy(view.masks)[None],
        )

    def complete(self, partial, grid, samples, generator):
        return [self.scene] * samples


def partial_of(view, camera):
    frame = frame_of(camera)
    free = torch.from_numpy(view.free)[None, None]
    far = torch.where(free, view.grid.truncation, -0.01)
    images = torch.from_numpy(frame.depth)[None]
    return PartialTSDF(far, free, images, stack_cameras([camera]))


class Shifted:
    """Restores images by moving all that they show 2 cm away from the camera."""

    def of(self, partial, grid):
        return replace(partial, depth=partial.depth + 0.02)


def test_edges_are_restored_before_anything_else():
    """The method inside and the fit see the restored image alone."""
    view, camera = view_of(32), camera_at(eye=(0.0, -0.85, 0.6))
    rough = Rough(view)
    asked = []
    rough.complete = lambda partial, *_: asked.append(partial) or [rough.scene]
    plain, moved = (
        Fitted(rough, SuperquadricFit(), EvidenceOfView(), edges=edges).complete(
            partial_of(view, camera), view.grid, 1, torch.Generator()
        )[0]
        for edges in (None, Shifted())
    )
    assert torch.allclose(asked[1].depth, asked[0].depth + 0.02)
    assert not torch.equal(plain.tsdf, moved.tsdf)


@pytest.mark.parametrize("resolution", [32, 64])
def test_boxes_come_out_sharp_and_whole(resolution):
    view, camera = view_of(resolution), camera_at(eye=(0.0, -0.85, 0.6))
    rough = Rough(view)
    method = Fitted(rough, SuperquadricFit(), EvidenceOfView())
    assert method.metadata == {"made": "by hand"}
    (scene,) = method.complete(partial_of(view, camera), view.grid, 1, torch.Generator())
    before, after, true = (
        volumes.tsdf[0].numpy() < 0 if isinstance(volumes, Completion) else volumes.tsdf < 0
        for volumes in (rough.scene, scene, view)
    )
    overlap = [(solid & true).sum() / (solid | true).sum() for solid in (before, after)]
    assert overlap[1] > overlap[0] + 0.1
    found = scene.instances[0].numpy()
    assert set(np.unique(found)) == {0, 1, 2}
    assert ((found > 0) == after).all()
    assert torch.equal(scene.masks, rough.scene.masks)
    volume = torch.zeros(1, 1, *view.grid.shape)
    without = PartialTSDF(volume, volume > 0)
    with pytest.raises(InputError, match="depth images"):
        method.complete(without, view.grid, 1, torch.Generator())


def test_draws_differ_in_what_is_hidden_and_agree_in_what_is_seen():
    view, camera = view_of(48), camera_at(eye=(0.0, -0.85, 0.6))
    empty = replace(view, tsdf=np.full_like(view.tsdf, 0.1), instances=0 * view.instances)
    method = Fitted(Rough(empty), SuperquadricFit(), EvidenceOfView())
    partial = partial_of(view, camera)

    def scenes(count, seed=0):
        return method.complete(partial, view.grid, count, torch.Generator().manual_seed(seed))

    (best,), (first, *drawn) = scenes(1), scenes(6)
    assert torch.equal(first.tsdf, best.tsdf)
    solid = torch.stack([scene.tsdf[0] < 0 for scene in (first, *drawn)])
    differs = (solid.any(dim=0) & ~solid.all(dim=0)).numpy()
    assert differs.sum() > 50
    assert not (differs & view.free).any()
    again = scenes(6)[3]
    assert torch.equal(again.tsdf, drawn[2].tsdf)
    assert not torch.equal(scenes(6, seed=1)[3].tsdf, drawn[2].tsdf)


def test_without_draws_all_samples_are_the_best_fit():
    view, camera = view_of(32), camera_at(eye=(0.0, -0.85, 0.6))
    method = Fitted(Rough(view), SuperquadricFit(), EvidenceOfView(), drawn=False)
    generator = torch.Generator()
    before = generator.get_state()
    first, second = method.complete(partial_of(view, camera), view.grid, 2, generator)
    assert second is first
    assert torch.equal(generator.get_state(), before)


def test_each_scene_is_drawn_as_often_as_it_stands():
    calls = []

    def draw(scene, count):
        calls.append((scene, count))
        return [f"{scene}{number}" for number in range(count)]

    assert each_drawn(["a", "b", "a"], draw) == ["a0", "b1", "a1"]
    assert calls == [("a", 2), ("b", 2)]


def test_what_no_superquadric_explains_stays_as_it_was():
    """An L: its seen points fit no convex shape."""
    view = view_of(32)
    whole = View(
        view.points, (view.masks > 0).astype(np.int32), view.tsdf,
        (view.instances > 0).astype(np.int32), view.free, view.grid,
    )  # fmt: skip
    strict = Fitted(Rough(view), SuperquadricFit(), EvidenceOfView(), near=0.002, explained=0.95)
    assert strict.superquadrics(whole) == [{}]
    tsdf, instances = composed({}, whole)
    np.testing.assert_array_equal(instances, whole.instances)
    assert ((tsdf < 0) == (whole.tsdf < 0)).all()


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
    view = view_of(48)
    view = replace(view, free=np.abs(view.grid.centres()[..., 0]) > 0.12)
    found = Fitted(Rough(view), SuperquadricFit(), EvidenceOfView()).superquadrics(view)[0]
    assert set(found) == {1, 2}
    assert Fitted(Rough(view), Elongated(), EvidenceOfView()).superquadrics(view) == [{}]
    blind = replace(view, free=np.zeros_like(view.free))
    assert Fitted(Rough(view), Elongated(), EvidenceOfView()).superquadrics(blind) != [{}]


def test_one_sharp_object_beside_one_that_stays():
    view = view_of(64)
    method = Fitted(Rough(view), SuperquadricFit(), EvidenceOfView())
    (label, sharp), *_ = method.superquadrics(view)[0].items()
    tsdf, instances = composed({label: sharp}, view)
    other = 3 - label
    kept = (instances == other).sum() / (view.instances == other).sum()
    assert 0.8 < kept <= 1
    assert ((instances > 0) == (tsdf < 0)).all()
    inside = distance(view.grid.centres(), STACK[label - 1]) < -0.01
    assert (instances[inside] == label).mean() > 0.85


def test_what_is_seen_but_not_predicted_becomes_an_object():
    view = view_of(64)
    empty = View(
        view.points, view.masks, np.full_like(view.tsdf, view.grid.truncation),
        np.zeros_like(view.instances), view.free, view.grid,
    )  # fmt: skip
    found = Fitted(Rough(view), SuperquadricFit(), EvidenceOfView()).superquadrics(empty)[0]
    assert set(found) == {1, 2}
    tsdf, instances = composed(found, empty)
    assert ((tsdf < 0) & (view.tsdf < 0)).sum() > 0.6 * ((tsdf < 0) | (view.tsdf < 0)).sum()
    assert set(np.unique(instances)) == {0, 1, 2}
    low = Fitted(Rough(view), SuperquadricFit(), EvidenceOfView(), lowest=0.15)
    assert set(low.superquadrics(empty)[0]) == {2}  # the other one is 12 cm high
    away = replace(empty, points=empty.points + (0.0, 2.0, 0.0))
    assert Fitted(Rough(view), SuperquadricFit(), EvidenceOfView()).superquadrics(away) == [{}]


@pytest.mark.parametrize("wrong", [{"near": 0}, {"explained": 1.5}, {"least": 0}])
def test_wrong_numbers_are_refused(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        Fitted(Rough(view_of(16)), SuperquadricFit(), EvidenceOfView(), **wrong)
