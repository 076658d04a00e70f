"""Draws of a network as what is expected of hidden parts, and as hidden objects."""

from dataclasses import dataclass, field, replace

import numpy as np
import torch
from tests.unit.perception.synthetic import camera_at
from tests.unit.perception.test_evidence import view_of

from scenefw.core.batches import SeenSetBatch
from scenefw.fitting.joint import JointFit
from scenefw.fitting.superquadrics import SuperquadricFit
from scenefw.models.superquadric_tokens import equal_descriptions
from scenefw.perception.drawn_sets import DrawnSets, along
from scenefw.perception.evidence import EvidenceOfView


class Told(torch.nn.Module):
    """Draws what it is told: half-axes of all seen objects, and one hidden object."""

    def __init__(self, size, hidden):
        super().__init__()
        self.size, self.where = size, hidden
        self.any = torch.nn.Parameter(torch.zeros(1))

    def sample(self, batch, count, generator, steps=20, *, given=True):
        parts = batch.seen.shape[1]
        slots = parts + 1
        places = torch.zeros(count, slots, 3)
        places[:, -1] = torch.tensor(self.where)
        sizes = torch.full((count, slots, 3), self.size)
        sizes[:, -1] = 0.01
        return SeenSetBatch(
            torch.zeros(count, slots, 4, 3), torch.ones(count, slots, dtype=torch.bool),
            torch.zeros(count, slots), torch.zeros(count, 3), sizes,
            torch.full((count, slots, 3), 4.0), torch.eye(3).expand(count, slots, 3, 3),
            places, torch.ones(count, slots, dtype=torch.bool),
        )  # fmt: skip


@dataclass
class Loaded:
    model: Told
    metadata: dict = field(default_factory=lambda: {"made": "by hand"})


@dataclass
class Inner:
    grid = None
    metadata: dict = field(default_factory=dict)


def method(size, hidden=(0.0, 0.0, 5.0)):
    fit = JointFit(SuperquadricFit())
    return DrawnSets(Inner(), fit, EvidenceOfView(), Loaded(Told(size, hidden)))


def seen():
    """Two boxes of which the predicted volume says nothing."""
    view, camera = view_of(48), camera_at(eye=(0.0, -0.85, 0.6))
    nothing = replace(view, tsdf=np.full_like(view.tsdf, 0.1), instances=0 * view.instances)
    return replace(nothing, eye=camera.T_world_camera[:3, 3])


def test_half_axes_are_told_along_other_axes():
    turn = equal_descriptions()[7].double().numpy()
    tilted = np.linalg.qr(np.eye(3) + 0.05 * np.random.default_rng(0).normal(size=(3, 3)))[0]
    tilted *= np.sign(np.diag(tilted))
    found = along(turn, tilted, np.array([1.0, 2.0, 3.0]))
    assert np.allclose(found, np.abs(turn).T @ [1.0, 2.0, 3.0])


def test_drawn_sizes_decide_where_the_view_is_silent():
    """Larger draws make larger objects, that the view allows all the same."""
    view = seen()
    volumes, first = [], []
    for size in (0.03, 0.12):
        best, drawn, _ = method(size).superquadrics(view, 3, np.random.default_rng(0))
        assert set(best) == {1, 2} == set(drawn)
        first.append([best[k].half_axes for k in (1, 2)])
        volumes.append([8 * np.prod(drawn[k].half_axes) for k in (1, 2)])
    assert np.array_equal(*first)  # the fit without a network
    small, large = np.array(volumes)
    assert (large > 1.05 * small).any()
    assert (large > 0.98 * small).all()


def test_hidden_objects_appear_where_nothing_is_seen_alone():
    view = seen()
    behind = view.eye + 1.25 * (view.points[view.masks == 1].mean(axis=0) - view.eye)
    behind[2] = 0.02
    turned = _in_view_frame(view, behind)
    best, drawn = method(0.05, tuple(turned)).superquadrics(view, 2, np.random.default_rng(0))
    hidden = [one for label, one in drawn.items() if label not in best]
    voxel = tuple(np.rint(view.grid.to_voxels(behind)).astype(int))
    assert len(hidden) == (0 if view.free[voxel] else 1)
    in_the_air = _in_view_frame(view, np.array([0.0, -0.3, 0.5]))
    _, drawn = method(0.05, tuple(in_the_air)).superquadrics(view, 2, np.random.default_rng(0))
    assert set(drawn) == set(best)


def _in_view_frame(view, place):
    """What a network must say for an object to be at a place of the world."""
    middle = np.mean([view.points[view.masks == k].mean(axis=0) for k in (1, 2)], axis=0)
    origin = np.array([middle[0], middle[1], 0.0])
    ahead = (origin - view.eye)[:2] / np.linalg.norm((origin - view.eye)[:2])
    turn = np.array([[*ahead, 0], [-ahead[1], ahead[0], 0], [0, 0, 1]])
    return (turn @ (place - origin)).astype(np.float32).tolist()
