import numpy as np
import pytest
import torch
from tests.unit.data.stacks_file import write_stacks

from scenefw.core.errors import ConfigError
from scenefw.core.geometry import look_at
from scenefw.core.rng import Streams
from scenefw.core.types import Camera, GridSpec
from scenefw.data.batches.augmentation import RigidAugmentation
from scenefw.data.batches.stacks import StackScenes
from scenefw.data.batches.views import ViewMaker
from scenefw.kernels.cameras import stack_cameras
from scenefw.mapping.projective import Projective
from scenefw.mapping.several_views import fused
from scenefw.noise.pose import Jitter
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw.representations.volumes import scene_volumes


class Circle:
    """Cameras on a circle: what RandomViewpoints does, without its package."""

    camera = Camera(80, 60, 70.0, 70.0, 39.5, 29.5)

    def sample(self, rng):
        return self.camera.moved(self._pose(rng.uniform(-np.pi, np.pi)))

    def poses(self, streams):
        return self._pose(np.pi * (2 * streams.uniform(1)[:, 0] - 1))

    def _pose(self, angle):
        eye = (0.9 * np.cos(angle), 0.9 * np.sin(angle), np.full_like(angle, 0.7))
        return look_at(np.stack(eye, axis=-1), (0, 0, 0.1))


class Shaking:
    """Adds white noise, so that streams of noise can be told apart."""

    def apply(self, depth, cameras, seeds):
        assert seeds.shape == depth.shape[:1]
        draws = [torch.Generator().manual_seed(seed) for seed in seeds.tolist()]
        noise = [torch.randn(depth.shape[1:], generator=draw) for draw in draws]
        return torch.where(depth > 0, depth + 0.01 * torch.stack(noise), depth)


def maker(resolution, **options):
    grid = GridSpec(resolution)
    return ViewMaker(grid, Circle(), SphereTracer(), Projective(), **options)


@pytest.fixture
def scenes(tmp_path):
    write_stacks(tmp_path / "stacks.npz")
    return StackScenes(tmp_path / "stacks.npz", "train")


def streams(*numbers):
    return Streams.of(0, indices=numbers)


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
def test_further_views_add_to_the_first(scenes, resolution):
    views = maker(resolution, noise={"shaking": Shaking()}, augmentation=RigidAugmentation())
    parameters, drawn = scenes.parameters([4, 1, 2]), streams(10, 11, 12)
    one = views.make(parameters, drawn)
    some = views.make(parameters, drawn, np.array([1, 3, 2]))
    assert torch.equal(one.depth, some.depth)
    assert torch.equal(one.volumes.tsdf, some.volumes.tsdf)
    assert torch.equal(one.partial.distance[0], some.partial.distance[0])
    seen = [int(made.partial.observed[1].sum()) for made in (one, some)]
    assert seen[1] > 1.1 * seen[0]
    assert bool((some.partial.observed | ~one.partial.observed).all())
    assert bool((some.partial.distance.abs() <= one.partial.distance.abs()).all())
    alone = views.make(scenes.parameters([1]), streams(11), np.array([3]))
    assert torch.equal(alone.partial.distance, some.partial.distance[1:2])


def test_several_views_are_fused_as_those_of_an_evaluation(scenes):
    """All views of one scene, whose cameras a viewpoint tells, and `fused` of the same images."""

    class Watched(Circle):
        def __init__(self):
            self.made = []

        def poses(self, drawn):
            self.made.append(super().poses(drawn))
            return self.made[-1]

    where = Watched()
    views = ViewMaker(GridSpec(32), where, SphereTracer(), Projective())
    made = views.make(scenes.parameters([1]), streams(11), np.array([3]))
    cameras = [stack_cameras([Circle.camera.moved(pose[0])], "cpu") for pose in where.made]
    assert len(cameras) == 3
    images = [SphereTracer().render(made.volumes.tsdf, views.grid, camera) for camera in cameras]
    pairs = zip(images, cameras, strict=True)
    apart = [Projective().fuse(image, views.grid, camera) for image, camera in pairs]
    together = fused(apart, views.grid)
    torch.testing.assert_close(made.partial.distance, together.distance, atol=1e-5, rtol=0)
    assert float((made.partial.observed != together.observed).float().mean()) < 1e-3


@pytest.mark.parametrize("resolution", [16, 32])
def test_the_view_shows_the_volumes(scenes, resolution):
    views = maker(resolution)
    made = views.make(scenes.parameters([0, 1]), streams(1, 2))
    shown = SphereTracer().render(made.volumes.tsdf, views.grid, made.cameras)
    assert torch.equal(made.depth, shown)
    fused = Projective().fuse(shown, views.grid, made.cameras)
    assert torch.equal(made.partial.distance, fused.distance)
    assert float((made.depth > 0).float().mean()) > 0.5


def test_noises_have_their_own_draws(scenes):
    """Two of a kind add up as independent ones do."""
    noises = {"first": Shaking(), "second": Shaking()}
    plain = maker(16).make(scenes.parameters([0]), streams(3))
    noisy = maker(16, noise=noises).make(scenes.parameters([0]), streams(3))
    spread = float((noisy.depth - plain.depth)[plain.depth > 0].std())
    assert spread == pytest.approx(0.01 * np.sqrt(2), rel=0.05)


def test_one_view_is_that_of_the_generator_and_of_its_camera(scenes):
    views = maker(16, noise={"shaking": Shaking()}, augmentation=RigidAugmentation())
    first, again = (
        views.make_one(scenes.parameters([1]), np.random.default_rng(3)) for _ in range(2)
    )
    other = views.make_one(scenes.parameters([1]), np.random.default_rng(4))
    assert torch.equal(first.depth, again.depth)
    assert not torch.equal(first.depth, other.depth)
    pose = Circle().sample(np.random.default_rng(3)).T_world_camera
    np.testing.assert_allclose(first.cameras.T_world_camera[0], pose, atol=1e-6)
    still = scene_volumes(scenes.parameters([1]), views.grid).tsdf
    assert torch.equal(first.volumes.tsdf, still)


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


def test_noise_of_poses_is_refused():
    with pytest.raises(ConfigError, match="leave out the pose noise tracking"):
        maker(16, noise={"shaking": Shaking(), "tracking": Jitter()})
