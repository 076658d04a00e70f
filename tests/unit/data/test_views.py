import subprocess
import sys

import numpy as np
import pytest
import torch
from tests.unit.data.stacks_file import write_stacks

from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, GridSpec
from scenefw.data.augmentation import RigidAugmentation
from scenefw.data.stacks import StackScenes
from scenefw.data.views import ViewMaker
from scenefw.mapping.projective import Projective
from scenefw.renderers.sphere_tracer import SphereTracer


class Circle:
    """Cameras on a circle: what RandomViewpoints does, without its package."""

    def sample(self, rng):
        angle = rng.uniform(-np.pi, np.pi)
        eye = (0.9 * np.cos(angle), 0.9 * np.sin(angle), 0.7)
        return Camera(80, 60, 70.0, 70.0, 39.5, 29.5, look_at(eye, (0, 0, 0.1)))


class Shaking:
    """Adds white noise, so that streams of noise can be told apart."""

    def apply(self, depth, cameras, generator):
        noise = torch.randn(depth.shape, generator=generator)
        return torch.where(depth > 0, depth + 0.01 * noise, depth)


def maker(resolution, **options):
    grid = GridSpec(resolution)
    return ViewMaker(grid, Circle(), SphereTracer(), Projective(), **options)


@pytest.fixture
def scenes(tmp_path):
    write_stacks(tmp_path / "stacks.npz")
    return StackScenes(tmp_path / "stacks.npz", "train")


def streams(*numbers):
    return [np.random.default_rng(n) for n in numbers]


@pytest.mark.parametrize("resolution", [16, 32])
def test_a_view_depends_on_its_own_stream_alone(scenes, resolution):
    views = maker(resolution, noise={"shaking": Shaking()}, augmentation=RigidAugmentation())
    together = views.make(scenes.parameters([4, 1, 2]), streams(10, 11, 12))
    alone = views.make(scenes.parameters([1]), streams(11))
    other = views.make(scenes.parameters([1]), streams(13))
    for name in ("tsdf", "votes", "instances"):
        mine = getattr(together.volumes, name)[1:2]
        assert torch.equal(mine, getattr(alone.volumes, name)), name
    assert torch.equal(together.depth[1:2], alone.depth)
    assert torch.equal(together.partial.distance[1:2], alone.partial.distance)
    assert not torch.equal(other.depth, alone.depth)


@pytest.mark.parametrize("resolution", [16, 32])
def test_the_view_shows_the_volumes(scenes, resolution):
    views = maker(resolution)
    made = views.make(scenes.parameters([0, 1]), streams(1, 2))
    shown = SphereTracer().render(made.volumes.tsdf, views.grid, made.cameras)
    assert torch.equal(made.depth, shown)
    fused = Projective().fuse(shown, views.grid, made.cameras)
    assert torch.equal(made.partial.distance, fused.distance)
    assert float((made.depth > 0).float().mean()) > 0.5


def test_one_generator_spawns_a_stream_per_scene(scenes):
    views = maker(16)
    first = views.make(scenes.parameters([0, 0]), np.random.default_rng(3))
    again = views.make(scenes.parameters([0, 0]), np.random.default_rng(3))
    assert torch.equal(first.depth, again.depth)
    assert not torch.equal(first.depth[0], first.depth[1])


def test_noise_is_applied_and_augmentation_moves(scenes):
    plain = maker(16).make(scenes.parameters([0]), streams(5))
    noisy = maker(16, noise={"shaking": Shaking()}).make(scenes.parameters([0]), streams(5))
    assert torch.equal(plain.volumes.tsdf, noisy.volumes.tsdf)
    seen = plain.depth > 0
    spread = float((noisy.depth - plain.depth)[seen].std())
    assert 0.008 < spread < 0.012
    moved = maker(16, augmentation=RigidAugmentation()).make(scenes.parameters([0]), streams(5))
    assert not torch.equal(plain.volumes.tsdf, moved.volumes.tsdf)


def test_images_can_be_made_smaller(scenes):
    views = maker(16, image_size=(40, 30))
    made = views.make(scenes.parameters([0]), streams(1))
    assert made.depth.shape == (1, 30, 40)
    assert float(made.cameras.intrinsics[0, 0]) == pytest.approx(35.0)


def test_training_imports_no_simulator_and_no_mesh_library():
    code = (
        "import scenefw.tasks.train, scenefw.data.views, scenefw.models.shape_instance_vae,"
        "scenefw.losses.mmd, scenefw.renderers.sphere_tracer, scenefw.mapping.inverse_ray_tracing;"
        "import sys; print([n for n in ('pybullet', 'open3d', 'trimesh') if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
