"""How far hypotheses differ, where that is known."""

import dataclasses

import numpy as np
import pytest
import trimesh
from tests.unit.export.stacks import stack

from scenefw.core.types import TriangleMesh
from scenefw.perception.estimate.objects import estimate_objects
from scenefw.perception.estimate.surface_spread import surface_spread


def balls(**radii):
    """Balls about one place, by id."""
    scene, meshes = stack(), {}
    for name, radius in radii.items():
        ball = trimesh.creation.icosphere(5, radius)
        meshes[int(name[1:])] = TriangleMesh(np.array(ball.vertices), np.array(ball.faces))
    return dataclasses.replace(scene, objects=estimate_objects(meshes, {}))


@pytest.mark.parametrize(
    ("radii", "expected"), [([0.05], 0.0), ([0.06], 0.01), ([0.04, 0.08], np.sqrt(5e-4))]
)
def test_it_is_the_root_mean_square_distance(radii, expected):
    first = balls(o1=0.05)
    (spread,) = surface_spread(first, [balls(o1=r) for r in radii]).values()
    assert spread.shape == (len(first.objects[0].mesh.vertices),)
    np.testing.assert_allclose(spread, expected, atol=4e-4)


def test_only_what_moves_is_uncertain():
    first, second = stack(), stack(shift=0.03)
    spread = surface_spread(first, [second])
    assert set(spread) == {1, 2, 3}
    assert spread[1].max() < 1e-6
    assert 0.005 < spread[3].max() <= 0.0301


def test_what_no_other_hypothesis_holds_is_left_out():
    first = balls(o1=0.05, o2=0.06)
    assert set(surface_spread(first, [balls(o2=0.05), balls(o3=0.1)])) == {2}
    assert surface_spread(first, []) == {}
