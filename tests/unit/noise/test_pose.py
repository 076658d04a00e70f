import numpy as np
import pytest
import torch

from scenefw.core.errors import ConfigError
from scenefw.core.geometry import rigid
from scenefw.core.types import Camera
from scenefw.noise.pose import Jitter


def moved(noise, count):
    """Positions and rotation angles (rad) relative to the true pose, of many draws."""
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    camera = Camera(T_world_camera=rigid(turn, (0.1, 0.2, 0.3)))
    poses = [
        noise.move(camera, torch.Generator().manual_seed(i)).T_world_camera for i in range(count)
    ]
    shifts = np.array([pose[:3, 3] for pose in poses]) - (0.1, 0.2, 0.3)
    cosines = [(np.trace(turn.T @ pose[:3, :3]) - 1) / 2 for pose in poses]
    return shifts, np.arccos(np.clip(cosines, -1, 1))


def test_amounts_are_those_asked_for():
    shifts, angles = moved(Jitter(sigma=0.002, rotation=0.01), 800)
    assert shifts.std(axis=0) == pytest.approx([0.002] * 3, rel=0.1)
    assert np.sqrt(np.mean(angles**2)) == pytest.approx(0.01 * np.sqrt(3), rel=0.1)


def test_rotation_follows_the_translation():
    assert Jitter(sigma=0.003, reach=0.3).rotation == pytest.approx(0.01)
    _, angles = moved(Jitter(sigma=0.003, rotation=0.0), 5)
    assert angles.max() < 1e-7


def test_no_amount_is_no_noise():
    camera = Camera()
    assert Jitter(sigma=0.0).move(camera, torch.Generator()) is camera


def test_amounts_share_their_draws():
    one, three = (moved(Jitter(sigma=s, rotation=0.0), 3)[0] for s in (0.001, 0.003))
    np.testing.assert_allclose(3 * one, three, atol=1e-12)


@pytest.mark.parametrize("wrong", [{"sigma": -1.0}, {"rotation": -0.1}, {"reach": 0.0}])
def test_amounts_are_checked(wrong):
    with pytest.raises(ConfigError, match="expected"):
        Jitter(**wrong)
