from types import SimpleNamespace

import numpy as np

from scenefw.core.types import Camera, Frame
from scenefw.noise.frames import depth_noises, described, disturb
from scenefw.noise.gaussian import Gaussian
from scenefw.noise.pose import Jitter


def frame():
    depth = np.full((12, 16), 0.3, np.float32)
    depth[0] = 0
    return Frame(depth, Camera().resized(16, 12), np.zeros((12, 16, 3), np.uint8), name="view")


def test_no_noise_changes_nothing():
    view = frame()
    assert disturb(view, {}, 0, 0, 0) is view


def test_amounts_of_zero_change_no_bit():
    view = frame()
    same = disturb(view, {"gaussian": Gaussian(0.0), "pose": Jitter(0.0)}, 0, 0, 0)
    assert same.depth.tobytes() == view.depth.tobytes()
    assert same.camera is view.camera


def test_seed_scene_and_frame_fix_the_noise():
    noises = {"gaussian": Gaussian(0.002), "pose": Jitter(0.001)}
    first, again = (disturb(frame(), noises, 1, 2, 3) for _ in range(2))
    np.testing.assert_array_equal(first.depth, again.depth)
    np.testing.assert_array_equal(first.camera.T_world_camera, again.camera.T_world_camera)
    for other in ((0, 2, 3), (1, 0, 3), (1, 2, 0)):
        assert not np.array_equal(first.depth, disturb(frame(), noises, *other).depth)


def test_one_noise_does_not_change_the_draws_of_another():
    alone = disturb(frame(), {"gaussian": Gaussian(0.002)}, 0, 0, 0)
    both = disturb(frame(), {"pose": Jitter(0.001), "gaussian": Gaussian(0.002)}, 0, 0, 0)
    np.testing.assert_array_equal(alone.depth, both.depth)
    assert not np.array_equal(alone.camera.T_world_camera, both.camera.T_world_camera)


def test_the_given_frame_stays_and_missing_depth_stays_missing():
    view = frame()
    noisy = disturb(view, {"gaussian": Gaussian(0.01)}, 0, 0, 0)
    assert (view.depth[1:] == np.float32(0.3)).all()
    assert (noisy.depth[0] == 0).all()
    assert noisy.colour is view.colour


def test_noise_is_told_with_its_amounts():
    noises = {"pose": Jitter(0.004, reach=0.4, lowest=0.0, share=0.5), "depth": Gaussian(0.01)}
    assert described(noises) == [
        "depth sigma=0.01 lowest=0.01 share=1",
        "pose sigma=0.004 rotation=0.01 lowest=0 share=0.5",
    ]
    assert described({}) == []
    own = SimpleNamespace(model="speckle", strength=0.12345, size=None)  # one of a plugin
    assert described({"own": own}) == ["own model=speckle strength=0.1235 size=None"]


class Scaled:
    """Multiplies depth, then adds to it: not the same in another order."""

    def __init__(self, factor, more):
        self.factor, self.more = factor, more

    def apply(self, depth, cameras, seeds):
        return depth * self.factor + self.more


def test_noises_are_applied_in_the_order_of_their_names():
    first, second = Scaled(2.0, 0.0), Scaled(1.0, 1.0)
    for noises in ({"a": first, "b": second}, {"b": second, "a": first}):
        seen = disturb(frame(), noises, 0, 0, 0).depth
        np.testing.assert_allclose(seen, 2 * frame().depth + 1)
        assert list(depth_noises(noises, "views")) == ["a", "b"]
