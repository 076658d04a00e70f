"""Fits of vessels to what a camera sees of them."""

import numpy as np
import pytest
from tests.unit.fitting.seen_vessels import EYE, seen

from scenefw.core.errors import ConfigError
from scenefw.fitting.vessels import VesselFit
from scenefw.shapes.vessel import Vessel

MUG = Vessel(0.04, 1.0, 1.0, 0.1, 0.004)
BOWL = Vessel(0.08, 0.4, 0.5, 0.06, 0.004)
CUP = Vessel(0.045, 0.7, 1.0, 0.11, 0.004)


def points_of(vessel, noise=0.001, eye=EYE):
    rng = np.random.default_rng(0)
    found = seen(vessel.mesh(), (0.07, -0.03), eye)
    found = found[rng.choice(len(found), 300, replace=False)]
    return found + noise * rng.normal(size=found.shape)


@pytest.mark.parametrize("eye", [EYE, np.array([-0.5, -0.5, 0.9])])
@pytest.mark.parametrize("vessel", [MUG, BOWL, CUP])
def test_it_finds_vessels_from_their_near_outside_and_far_inside(vessel, eye):
    one = VesselFit().fit(points_of(vessel, eye=eye), eye)
    np.testing.assert_allclose(one.pose.position[:2], (0.07, -0.03), atol=0.003)
    assert one.shape.radius == pytest.approx(vessel.radius, rel=0.06)
    assert one.shape.height == pytest.approx(vessel.height, abs=0.004)
    middle = [np.interp(s.height / 2, *s.outside[1:, ::-1].T) for s in (one.shape, vessel)]
    assert middle[0] == pytest.approx(middle[1], abs=0.005)
    assert one.pose.position[2] + one.shape.bottom == pytest.approx(0, abs=1e-9)
    assert (np.abs(one.distances) < 0.004).mean() > 0.95


def test_points_of_the_far_wall_are_on_the_inside():
    points = points_of(MUG)
    one = VesselFit().fit(points, EYE)
    far = (points - [0.07, -0.03, 0])[:, :2] @ (EYE - [0.07, -0.03, 0])[:2] < 0
    low = points[:, 2] < 0.095
    assert (one.inside == far)[low].mean() > 0.97


def test_a_handle_does_not_mislead_it():
    points = points_of(CUP)
    rng = np.random.default_rng(1)
    handle = np.array([0.07 + 0.06, -0.03, 0.06]) + 0.01 * rng.uniform(-1, 1, (40, 3))
    one = VesselFit().fit(np.concatenate([points, handle]), EYE)
    np.testing.assert_allclose(one.pose.position[:2], (0.07, -0.03), atol=0.004)
    assert one.shape.radius == pytest.approx(CUP.radius, rel=0.1)


def test_points_of_one_height_have_a_fit_too():
    x, y = np.meshgrid(np.linspace(-0.05, 0.05, 20), np.linspace(-0.05, 0.05, 20))
    flat = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 0.08)])
    assert np.isfinite(VesselFit().fit(flat, EYE).distances).all()


@pytest.mark.parametrize("wrong", [{"sigma": 0.0}, {"wall": 0.001}, {"steps": 0}])
def test_bad_settings(wrong):
    with pytest.raises(ConfigError, match=f"^{next(iter(wrong))} = "):
        VesselFit(**wrong)
