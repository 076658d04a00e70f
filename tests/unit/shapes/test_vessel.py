"""Vessels: numbers of solids of revolution that are known otherwise, and distances to meshes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull, cKDTree

from scenefw.core.errors import InputError
from scenefw.shapes.solid_mesh import closed
from scenefw.shapes.vessel import Vessel

MUG = Vessel(0.04, 1.0, 1.0, 0.1, 0.004)
BOWL = Vessel(0.08, 0.4, 0.5, 0.06, 0.005)
CUP = Vessel(0.045, 0.7, 1.0, 0.11, 0.003)


def test_a_straight_one_has_the_volume_of_a_tube_and_a_disc():
    true = np.pi * (0.04**2 - 0.036**2) * 0.096 + np.pi * 0.04**2 * 0.004
    assert MUG.volume() == pytest.approx(true, rel=0.01)


def test_a_cone_has_the_volume_of_two_frusta():
    def frustum(low, high, height):
        return np.pi * height / 3 * (low**2 + low * high + high**2)

    across = 0.003 * np.hypot(1, 0.045 * 0.3 / 0.11)
    outer = [0.045 * (0.7 + 0.3 * z / 0.11) for z in (0.0, 0.003, 0.11)]
    hollow = frustum(outer[1] - across, outer[2] - across, 0.107)
    assert CUP.volume() == pytest.approx(frustum(outer[0], outer[2], 0.11) - hollow, rel=0.01)


@given(
    radius=st.floats(0.02, 0.12),
    base=st.floats(0.3, 1.1),
    curve=st.floats(0.3, 2.0),
    height=st.floats(0.02, 0.2),
    wall=st.floats(0.002, 0.008),
)
def test_surfaces_are_closed_about_the_centre_of_mass(radius, base, curve, height, wall):
    vessel = Vessel(radius, base, curve, height, wall)
    mesh = vessel.mesh()
    assert closed(mesh)
    assert vessel.volume() > 0
    assert mesh.vertices[:, 2].min() == pytest.approx(vessel.bottom, abs=1e-9)
    assert np.ptp(mesh.vertices[:, 2]) == pytest.approx(height)
    solid = vessel.solid()
    assert solid.volume() == pytest.approx(vessel.volume())
    # Its pieces are chords of a wall that may bend, so they hold a little more or less
    pieces = sum(ConvexHull(part).volume for part in solid.parts)
    assert pieces == pytest.approx(vessel.volume(), rel=0.35)


@pytest.mark.parametrize("vessel", [MUG, BOWL, CUP])
def test_distances_are_those_to_a_fine_mesh(vessel):
    rng = np.random.default_rng(0)
    places = rng.uniform(-0.12, 0.12, (2000, 3))
    near = cKDTree(sampled(vessel.mesh(sections=400))).query(places)[0]
    off = np.abs(np.abs(vessel.wall_distance(places)) - near)
    # Where the wall lies rather than stands, it is a little thinner than a wall all around
    assert np.quantile(off, 0.95) < 0.003
    assert (vessel.wall_distance(places) < 0).mean() < 0.1
    filled = vessel.filled_distance(places)
    inside = filled < -vessel.wall
    assert inside.any()
    assert (vessel.wall_distance(places[inside]) > 0).mean() > 0.9  # free, but under the lid
    assert (vessel.wall_distance(places[filled > 0]) > -1e-9).all()


@pytest.mark.parametrize("vessel", [MUG, BOWL, CUP])
def test_what_it_holds_lies_in_its_mesh_with_a_lid_on(vessel):
    o3d = pytest.importorskip("open3d")
    places = np.random.default_rng(2).uniform(-0.12, 0.12, (4000, 3)).astype(np.float32)
    filling, scene = vessel.filled_mesh(), o3d.t.geometry.RaycastingScene()
    corners = o3d.core.Tensor(np.float32(filling.vertices))
    scene.add_triangles(corners, o3d.core.Tensor(np.uint32(filling.faces)))
    inside = scene.compute_occupancy(o3d.core.Tensor(places)).numpy() > 0
    assert 0.01 < inside.mean() < 0.5
    assert ((vessel.filled_distance(places.astype(np.float64)) < 0) == inside).mean() > 0.99


@pytest.mark.parametrize("vessel", [MUG, BOWL])
def test_its_moments_of_inertia_are_those_about_its_own_axes(vessel):
    points = np.random.default_rng(0).uniform(-0.1, 0.1, (100_000, 3))
    points = points[vessel.wall_distance(points) < 0]
    squares = (points**2).mean(axis=0)
    np.testing.assert_allclose(vessel.solid().inertia(), squares.sum() - squares, rtol=0.08)


def sampled(mesh):
    rng = np.random.default_rng(1)
    corners = mesh.vertices[mesh.faces]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    rows = rng.choice(len(areas), 200_000, p=areas / areas.sum())
    a, b = np.sqrt(rng.random(len(rows))), rng.random(len(rows))
    shares = np.stack([1 - a, a * (1 - b), a * b], axis=1)
    return np.einsum("nk,nkj->nj", shares, corners[rows])


def test_a_larger_one_is_the_same_shape():
    np.testing.assert_allclose(
        BOWL.scaled(2.0).mesh().vertices, 2 * BOWL.mesh().vertices, atol=2e-4
    )


@pytest.mark.parametrize(
    "numbers", [(0.0, 1, 1, 0.1, 0.004), (0.04, 1, 1, np.nan, 0.004), (0.04, 1, 1, 0.1, 0.05)]
)
def test_bad_numbers(numbers):
    with pytest.raises(InputError, match="vessel"):
        Vessel(*numbers)
