"""Scenes drawn without a view: solids that stand, with volumes, an image and masks."""

from dataclasses import dataclass, field

import numpy as np
import pytest
import torch

from scenefw.core.errors import ConfigError
from scenefw.core.set_flows import SetFlowBatch
from scenefw.core.types import GridSpec
from scenefw_scene_prior.prior import ScenePrior
from scenefw_simulators.body_maker import BodyMaker
from scenefw_simulators.engines.pybullet_engine import PyBulletEngine
from scenefw_simulators.settling import PhysicalSettling

GRID = GridSpec(48)
HALF = 0.05  # m, of the blocks


class Told(torch.nn.Module):
    """Draws blocks at places that it is told: a list of scenes, each a list of centres."""

    draws_hidden = True

    def __init__(self, scenes):
        super().__init__()
        self.told = scenes
        self.any = torch.nn.Parameter(torch.zeros(1))

    def scenes(self, count, generator, steps=20, objects=None):
        slots = max(len(one) for one in self.told)
        places = torch.full((count, slots, 3), float("nan"))
        present = torch.zeros(count, slots, dtype=torch.bool)
        for row in range(count):
            scene = self.told[row % len(self.told)]
            places[row, : len(scene)] = torch.tensor(scene)
            present[row, : len(scene)] = True
        return SetFlowBatch(
            torch.zeros(count, slots, 1, 3), torch.zeros_like(present),
            torch.zeros(count, slots), torch.zeros(count, slots, 1, 7), torch.zeros(count, 3),
            torch.full((count, slots, 3), HALF), torch.full((count, slots, 3), 20.0),
            torch.eye(3).expand(count, slots, 3, 3), places, present,
        )  # fmt: skip


@dataclass
class Loaded:
    model: Told
    metadata: dict = field(default_factory=dict)


def test_a_draw_is_a_scene_with_volumes_an_image_and_masks():
    prior = ScenePrior(Loaded(Told([[(0.0, 0.0, HALF), (0.0, 0.2, HALF)]])), GRID)
    (scene,) = prior.scenes(1)
    assert [item.id for item in scene.objects] == [1, 2]
    inside = np.abs(GRID.centres() - (0.0, 0.2, HALF)).max(axis=-1) < HALF - GRID.voxel_size
    assert (scene.instances[inside] == 2).all()
    assert (scene.tsdf[inside] < 0).all()
    assert np.abs(scene.tsdf).max() <= GRID.truncation + 1e-6
    assert set(np.unique(scene.masks)) == {0, 1, 2}
    depth, camera = scene.frame.depth, scene.frame.camera
    v, u = np.argwhere(scene.masks == 2).mean(axis=0)
    ray = [(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0]
    seen = camera.T_world_camera @ [*(depth[int(v), int(u)] * np.array(ray)), 1.0]
    assert np.abs(seen[:3] - (0.0, 0.2, HALF)).max() < HALF + 0.01
    corner = camera.T_world_camera @ [*(depth[-1, 0] * np.array(
        [-camera.cx / camera.fx, (479 - camera.cy) / camera.fy, 1.0])), 1.0]  # fmt: skip
    assert corner[2] == pytest.approx(0, abs=1e-5)  # the floor


def test_a_scene_depends_on_its_seed_and_number_alone():
    class Random(Told):
        def scenes(self, count, generator, steps=20, objects=None):
            made = super().scenes(count, generator, steps, objects)
            made.positions[..., 0] = torch.rand(count, 1, generator=generator) / 5
            return made

    prior = ScenePrior(Loaded(Random([[(0.0, 0.0, HALF)]])), GRID)
    several = [one.objects[0].pose.position for one in prior.scenes(3, seed=4)]
    again = [one.objects[0].pose.position for one in prior.scenes(2, seed=4)]
    assert np.array_equal(several[:2], again)
    assert len({round(float(one[0]), 6) for one in several}) == 3


def test_piles_that_fall_are_drawn_anew_and_others_pushed_apart():
    pytest.importorskip("pybullet", reason="needs pybullet (pip install 'scenefw[simulation]')")
    settling = PhysicalSettling(PyBulletEngine(), BodyMaker())
    falls = [(0.0, 0.0, 0.6)]
    outside = [(2.0, 0.0, HALF)]
    deep = [(0.0, 0.0, HALF), (0.09, 0.0, HALF)]  # 1 cm in each other
    prior = ScenePrior(Loaded(Told([falls, outside, deep])), GRID, settling)
    (scene,) = prior.scenes(1)
    assert scene.details["drawn"]["draws"] == 3
    assert scene.details["settled"]["stable"]
    first, second = (item.pose.position for item in scene.objects)
    assert second[0] - first[0] == pytest.approx(2 * HALF, abs=3e-3)
    with pytest.raises(ConfigError, match=r"none of 2 draws stands; raise run\.prior\.attempts"):
        list(ScenePrior(Loaded(Told([falls])), GRID, settling, attempts=2).scenes(1))


def test_what_draws_no_scenes_is_refused():
    model = Told([[]])
    model.draws_hidden = False
    with pytest.raises(ConfigError, match=r"checkpoints\.set_flow=FILE"):
        ScenePrior(Loaded(model), GRID)
    with pytest.raises(ConfigError, match="attempts 0"):
        ScenePrior(Loaded(Told([[]])), GRID, attempts=0)
