import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from scenefw.core.batches import SceneParameters
from scenefw.core.errors import ConfigError
from scenefw.core.rng import Streams
from scenefw.core.types import GridSpec
from scenefw.data.batches.augmentation import RigidAugmentation
from scenefw.representations.volumes import scene_volumes


def scene(seed, objects=2):
    rng = np.random.default_rng(seed)
    q, _ = np.linalg.qr(rng.normal(size=(1, objects, 3, 3)))
    q *= np.sign(np.linalg.det(q))[..., None, None]
    fields = (
        rng.uniform(0.05, 0.1, (1, objects, 3)),
        rng.uniform(2, 6, (1, objects, 3)),
        q,
        rng.uniform([-0.15, -0.15, 0.1], [0.15, 0.15, 0.2], (1, objects, 3)),
    )
    tensors = [torch.as_tensor(f, dtype=torch.float32) for f in fields]
    return SceneParameters(*tensors, torch.ones(1, objects, dtype=torch.bool))


def motions(*motion):
    return torch.tensor([motion], dtype=torch.float32)


CENTRED = {"extent": 1.0, "lower": (-0.5, -0.5, -0.096)}


@pytest.mark.parametrize("resolution", [16, 32])
def test_a_quarter_turn_is_a_quarter_turn_of_the_volumes(resolution):
    grid = GridSpec(resolution, **CENTRED)
    augmentation = RigidAugmentation()
    before = scene_volumes(scene(0), grid)
    after = scene_volumes(augmentation.apply(scene(0), motions(math.pi / 2, 0.0, 0.0)), grid)
    # A quarter turn takes voxel (x, y) to (-y, x).
    np.testing.assert_allclose(after.tsdf, torch.rot90(before.tsdf, 1, (2, 3)), atol=2e-4)
    x, y, z = torch.rot90(before.votes, 1, (2, 3)).unbind(dim=1)
    same = torch.rot90(before.instances, 1, (1, 2)) == after.instances
    expected = torch.stack([-y, x, z], dim=1)
    difference = (after.votes - expected).abs().amax(dim=1)
    assert float(difference[same].max()) < 1e-3
    assert float(same.float().mean()) > 0.999


@pytest.mark.parametrize("resolution", [16, 32])
def test_a_shift_by_whole_voxels_shifts_the_volumes(resolution):
    grid = GridSpec(resolution, **CENTRED)
    step = grid.voxel_size
    before = scene_volumes(scene(1), grid).tsdf
    after = scene_volumes(RigidAugmentation().apply(scene(1), motions(0.0, step, -step)), grid).tsdf
    np.testing.assert_allclose(after[:, :, 1:, :-1], before[:, :, :-1, 1:], atol=2e-4)


@given(
    seed=st.integers(0, 2**32 - 1),
    angle=st.floats(-7, 7),
    shift=st.tuples(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2)),
)
def test_motion_is_rigid_and_stays_on_the_floor(seed, angle, shift):
    before = scene(seed, objects=3)
    after = RigidAugmentation().apply(before, motions(angle, *shift))
    identity = after.rotations @ after.rotations.transpose(-1, -2)
    np.testing.assert_allclose(identity, torch.eye(3).expand_as(identity), atol=1e-5)
    np.testing.assert_allclose(after.positions[..., 2], before.positions[..., 2], atol=1e-6)
    np.testing.assert_allclose(
        torch.cdist(after.positions, after.positions, compute_mode="donot_use_mm_for_euclid_dist"),
        torch.cdist(
            before.positions, before.positions, compute_mode="donot_use_mm_for_euclid_dist"
        ),
        atol=1e-5,
    )
    # Relative orientations are kept: a point fixed in one object moves as the scene does.
    corner = before.positions[0, 0] + before.rotations[0, 0] @ before.half_axes[0, 0]
    moved = after.positions[0, 0] + after.rotations[0, 0] @ before.half_axes[0, 0]
    c, s = math.cos(angle), math.sin(angle)
    x, y, z = corner.tolist()
    expected = [c * x - s * y + shift[0], s * x + c * y + shift[1], z]
    np.testing.assert_allclose(moved, expected, atol=1e-5)


def test_draws_are_uniform_and_follow_their_streams():
    augmentation = RigidAugmentation(rotation=0.3, shift=0.02)
    draws = augmentation.draw(Streams.of(0, indices=range(2000)))
    for values, limit in zip(draws.T, (0.3, 0.02, 0.02), strict=True):
        assert stats.kstest(values, stats.uniform(-limit, 2 * limit).cdf).pvalue > 1e-3
    assert np.abs(np.corrcoef(draws.T)[np.triu_indices(3, 1)]).max() < 0.1
    alone = augmentation.draw(Streams.of(0, indices=[5]))
    np.testing.assert_array_equal(alone[0], draws[5])


def test_every_scene_of_a_batch_has_its_own_motion():
    both = [scene(3), scene(4)]
    fields = ("half_axes", "exponents", "rotations", "positions", "present")
    batch = SceneParameters(*(torch.cat([getattr(s, name) for s in both]) for name in fields))
    given = torch.tensor([[0.3, 0.01, 0.02], [-2.0, 0.03, -0.01]])
    together = RigidAugmentation().apply(batch, given)
    for i, alone in enumerate(both):
        moved = RigidAugmentation().apply(alone, given[i : i + 1])
        assert torch.equal(together.positions[i : i + 1], moved.positions)
        assert torch.equal(together.rotations[i : i + 1], moved.rotations)


def test_negative_range_is_refused():
    with pytest.raises(ConfigError, match="shift = -1"):
        RigidAugmentation(shift=-1)
