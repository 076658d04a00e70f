"""Scene volumes against mesh distances, closed forms and what must hold whatever the scene."""

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from scenefw.core.errors import InputError
from scenefw.core.geometry import rotation_from_quaternion
from scenefw.core.types import GridSpec
from scenefw.representations.volumes import object_occupancy, scene_volumes

_spec = importlib.util.spec_from_file_location("reference", Path(__file__).parent / "reference.py")
reference = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(reference)

COARSE = GridSpec(resolution=20)
axes = st.floats(0.025, 0.15)
powers = st.floats(2, 100)
triple = st.tuples(axes, axes, axes)
power_triple = st.tuples(powers, powers, powers)
directions = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: sum(c * c for c in q) > 0.1)
few = settings(max_examples=12, deadline=None)


def test_matches_mesh_distance():
    pytest.importorskip("open3d", exc_type=ImportError)
    resolution, seed = 64, 1
    grid = GridSpec(resolution=resolution)
    p = reference.random_scenes(1, 3, seed)
    volumes = scene_volumes(p, grid)
    chosen = np.random.default_rng(seed).permutation(resolution**3)[:8000]
    truth = reference.mesh_distances(p, 0, grid.centres().reshape(-1, 3)[chosen])
    nearest = np.clip(truth.min(0), -grid.truncation, grid.truncation)
    error = np.abs(volumes.tsdf[0, 0].flatten().numpy()[chosen] - nearest) / grid.voxel_size
    band = np.abs(nearest) < grid.truncation
    assert band.sum() > 200
    assert error[band].mean() <= 0.01
    assert error.max() <= 0.15
    labels = volumes.instances[0].flatten().numpy()[chosen]
    gap = np.sort(truth, axis=0)
    clear = (np.abs(gap[0]) > 1e-3) & (gap[1] - gap[0] > 3e-3)  # no tie within the tolerance
    expected = np.where(truth.min(0) < 0, truth.argmin(0) + 1, 0)
    assert (labels[clear] == expected[clear]).all()


@pytest.mark.parametrize("resolution", [32, 64])
def test_sphere_is_exact(resolution):
    grid = GridSpec(resolution=resolution, truncation_voxels=8)
    centre, radius = np.array([0.03, -0.02, 0.21]), 0.12
    p = reference.one_object([radius] * 3, [2, 2, 2], position=centre)
    truth = np.linalg.norm(grid.centres() - centre, axis=-1) - radius
    tsdf = scene_volumes(p, grid).tsdf[0, 0].numpy()
    assert (
        np.abs(tsdf - truth.clip(-grid.truncation, grid.truncation)).max() < 0.01 * grid.voxel_size
    )


def test_exponent_100_is_nearly_a_box():
    half = np.array([0.05, 0.1, 0.14])
    p = reference.one_object(half, [100, 100, 100])
    grid = GridSpec()
    excess = np.abs(grid.centres() - [0, 0, 0.2]) - half
    box = np.linalg.norm(excess.clip(0), axis=-1) + excess.max(-1).clip(max=0)
    tsdf = scene_volumes(p, grid).tsdf[0, 0].numpy()
    error = tsdf - box.clip(-grid.truncation, grid.truncation)
    corner = np.linalg.norm(half * (1 - 3 ** (-1 / 100)))  # how far the corner is rounded
    assert error.min() > -1e-5  # the box holds the superquadric
    assert error.max() < corner + 1e-5
    assert np.median(np.abs(error)) < 1e-4


@few
@given(triple, power_triple)
def test_mirrored_grids_give_mirrored_volumes(half, exponents):
    grid = replace(COARSE, lower=(-0.5, -0.5, -0.5))
    volumes = scene_volumes(reference.one_object(half, exponents, position=(0, 0, 0)), grid)
    clear = volumes.tsdf.abs() > 1e-5  # rounding decides whether the others are inside
    for axis in range(3):
        assert torch.allclose(volumes.tsdf, volumes.tsdf.flip(2 + axis), atol=2e-6)
        mirrored = volumes.votes.flip(2 + axis).clone()
        mirrored[:, axis] *= -1
        assert torch.allclose(volumes.votes * clear, mirrored * clear, atol=1e-5)


@few
@given(triple, power_triple, directions)
def test_turning_object_and_grid_together_changes_nothing(half, exponents, quaternion):
    rotation = rotation_from_quaternion(quaternion)
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])  # keeps the grid's voxels in place
    grid = replace(COARSE, lower=(-0.5, -0.5, -0.5))
    still = scene_volumes(reference.one_object(half, exponents, rotation, (0, 0, 0)), grid)
    turned = scene_volumes(
        reference.one_object(half, exponents, quarter @ rotation, (0, 0, 0)), grid
    )
    assert torch.allclose(turned.tsdf, torch.rot90(still.tsdf, 1, (2, 3)), atol=2e-4)


@few
@given(triple, power_triple, directions)
def test_distance_changes_no_faster_than_position(half, exponents, quaternion):
    p = reference.one_object(half, exponents, rotation_from_quaternion(quaternion))
    tsdf = scene_volumes(p, COARSE).tsdf
    for axis in (2, 3, 4):
        assert tsdf.diff(dim=axis).abs().max() <= COARSE.voxel_size + 2e-3


@few
@given(triple, power_triple)
def test_sign_is_that_of_the_implicit_function(half, exponents):
    p = reference.one_object(half, exponents)
    u = np.abs(COARSE.centres() - [0, 0, 0.2]) / half
    with np.errstate(over="ignore"):
        value = (u ** np.array(exponents)).sum(-1)
    tsdf = scene_volumes(p, COARSE).tsdf[0, 0].numpy()
    clear = np.abs(value - 1) > 1e-3
    assert ((tsdf < 0) == (value < 1))[clear].all()


def test_batch_equals_single_scenes():
    p = reference.random_scenes(3, 4, 5)
    together = scene_volumes(p, COARSE)
    for i in range(3):
        part = replace(p, **{name: getattr(p, name)[i : i + 1] for name in vars(p)})
        alone = scene_volumes(part, COARSE)
        for name in ("tsdf", "votes", "instances"):
            assert torch.equal(getattr(alone, name)[0], getattr(together, name)[i])


def test_absent_objects_leave_no_trace():
    p = reference.random_scenes(1, 4, 6)
    present = torch.tensor([[True, False, True, True]])
    nan = torch.full_like(p.half_axes[:, 1], torch.nan)
    p.half_axes[:, 1], p.exponents[:, 1] = nan, nan
    keep = [0, 2, 3]
    kept = replace(p, **{name: getattr(p, name)[:, keep] for name in vars(p)})
    with_gap = scene_volumes(replace(p, present=present), COARSE)
    without = scene_volumes(replace(kept, present=torch.ones(1, 3, dtype=torch.bool)), COARSE)
    assert torch.equal(with_gap.tsdf, without.tsdf)
    assert set(with_gap.instances.unique().tolist()) == {0, 1, 3, 4}
    assert not object_occupancy(replace(p, present=present), COARSE)[:, 1].any()


def test_empty_scene():
    p = replace(reference.random_scenes(2, 3, 7), present=torch.zeros(2, 3, dtype=torch.bool))
    volumes = scene_volumes(p, COARSE)
    assert (volumes.tsdf == np.float32(COARSE.truncation)).all()
    assert not volumes.instances.any()
    assert not volumes.votes.any()


def test_votes_point_to_the_centre_of_the_labelled_object():
    p = reference.random_scenes(2, 4, 8)
    grid = GridSpec(resolution=32)
    volumes = scene_volumes(p, grid)
    centres = torch.from_numpy(grid.centres()).float()
    for scene in range(2):
        labels = volumes.instances[scene]
        inside = labels > 0
        away = p.positions[scene][(labels[inside] - 1).long()] - centres[inside]
        expected = away / away.norm(dim=-1, keepdim=True)
        assert torch.allclose(volumes.votes[scene][:, inside].T, expected, atol=1e-4)
        assert not volumes.votes[scene][:, ~inside].any()
        assert torch.equal(inside, volumes.tsdf[scene, 0] < 0)


def test_voxel_at_the_centre_votes_for_nowhere():
    grid = GridSpec(resolution=9, lower=(-0.5, -0.5, -0.5))
    p = reference.one_object([0.15] * 3, [2, 2, 2], position=(0, 0, 0))
    votes = scene_volumes(p, grid).votes
    assert torch.isfinite(votes).all()
    assert votes[0, :, 4, 4, 4].norm() <= 1


def test_far_away_object_is_out_of_reach():
    p = reference.one_object([0.1] * 3, [2, 2, 2], position=(5, 0, 0))
    assert (scene_volumes(p, COARSE).tsdf == np.float32(COARSE.truncation)).all()


def test_result_needs_contiguous_nothing():
    p = reference.random_scenes(2, 4, 9)
    strided = replace(p, half_axes=p.half_axes.flip(-1).flip(-1).transpose(0, 1).transpose(0, 1))
    strided = replace(strided, rotations=p.rotations.mT.contiguous().mT)
    assert torch.equal(scene_volumes(p, COARSE).tsdf, scene_volumes(strided, COARSE).tsdf)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("half_axes", torch.zeros(1, 4, 3), "half-axes"),
        ("exponents", torch.full((1, 4, 3), 0.5), "exponents"),
        ("positions", torch.full((1, 4, 3), torch.nan), "position"),
        ("positions", torch.zeros(1, 3, 3), "positions"),
        ("rotations", torch.zeros(1, 4, 4), "rotations"),
    ],
)
def test_bad_input_is_named(field, value, message):
    p = replace(reference.random_scenes(1, 4, 10), **{field: value})
    with pytest.raises(InputError, match=message):
        scene_volumes(p, COARSE)
