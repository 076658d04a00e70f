import numpy as np
import pytest
import torch
from scipy import stats
from scipy.spatial.transform import Rotation

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


@pytest.mark.parametrize(
    "wrong",
    [
        {"sigma": -1.0},
        {"rotation": -0.1},
        {"reach": 0.0},
        {"sigma": 0.001, "lowest": 0.002},
        {"share": -0.1},
    ],
)
def test_amounts_are_checked(wrong):
    with pytest.raises(ConfigError, match="expected"):
        Jitter(**wrong)


def spreads(moves):
    """Root mean square shift (m) and angle (rad) of many relative poses (B, 4, 4)."""
    angles = Rotation.from_matrix(moves[:, :3, :3]).magnitude()
    return np.sqrt(np.mean(moves[:, :3, 3] ** 2)), np.sqrt(np.mean(angles**2) / 3)


def test_many_cameras_move_as_one_does():
    draws = np.random.default_rng(0).random((4000, Jitter.DRAWS))
    noise = Jitter(sigma=0.002, rotation=0.01)
    moves = noise.moves(draws)
    assert spreads(moves) == pytest.approx((0.002, 0.01), rel=0.03)
    for axis in range(3):
        assert stats.kstest(moves[:, axis, 3] / 0.002, "norm").pvalue > 1e-3
    single = np.stack(
        [noise.move(Camera(), torch.Generator().manual_seed(i)).T_world_camera for i in range(4000)]
    )
    assert spreads(single) == pytest.approx(spreads(moves), rel=0.05)


def test_cameras_draw_their_own_amount_and_a_share_of_them_moves():
    draws = np.random.default_rng(1).random((6000, Jitter.DRAWS))
    moves = Jitter(sigma=0.004, rotation=0.01, lowest=0.001, share=0.25).moves(draws)
    still = (moves == np.eye(4)).all(axis=(1, 2))
    assert stats.binomtest(int((~still).sum()), 6000, 0.25).pvalue > 1e-3
    shift, angle = spreads(moves[~still])
    # Of sigma even between 1 and 4 mm, the mean square is (1 + 4 + 16) / 3
    assert shift == pytest.approx(0.001 * np.sqrt(7), rel=0.05)
    assert angle == pytest.approx(0.01 / 4 * np.sqrt(7), rel=0.05)
    camera = Camera()
    poses = [
        Jitter(0.004, share=0.25).move(camera, torch.Generator().manual_seed(i)).T_world_camera
        for i in range(400)
    ]
    moved_ones = sum(not np.array_equal(pose, np.eye(4)) for pose in poses)
    assert stats.binomtest(moved_ones, 400, 0.25).pvalue > 1e-3
