import numpy as np
import pytest
import trimesh

from scenefw.core.types import TriangleMesh
from scenefw_single_view_benchmarks.solid_overlap import best_solid_ious


def box(low, high):
    mesh = trimesh.creation.box(bounds=(low, high))
    return TriangleMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces))


def test_boxes_overlap_as_their_volumes_say():
    first = box((0, 0, 0), (0.2, 0.1, 0.1))
    half = box((0.1, 0, 0), (0.3, 0.1, 0.1))
    far = box((1, 0, 0), (1.1, 0.1, 0.1))
    ious = best_solid_ious([first, half, far], [first, box((0, 0, 0), (0.2, 0.1, 0.05))])
    assert ious == pytest.approx([1.0, 1 / 3, 0.0], abs=0.01)
    assert best_solid_ious([first], []).tolist() == [0.0]
    assert best_solid_ious([], [first]).tolist() == []
