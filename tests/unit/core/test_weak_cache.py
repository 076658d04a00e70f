"""Results that live as long as what they were computed of."""

import gc
import weakref

import numpy as np

from scenefw.core.types import TriangleMesh
from scenefw.core.weak_cache import cached_by_identity


class Area:
    def __init__(self, mesh):
        self.vertices = mesh.vertices


def mesh():
    return TriangleMesh(np.eye(3), np.array([[0, 1, 2]]))


def test_a_result_is_computed_once_for_each_object():
    area_of = cached_by_identity(Area)
    first, second = mesh(), mesh()  # of equal numbers
    assert area_of(first) is area_of(first)
    assert area_of(second) is not area_of(first)


def test_a_result_goes_with_its_object():
    area_of = cached_by_identity(Area)
    solid = mesh()
    result = weakref.ref(area_of(solid))
    assert result() is not None
    del solid
    gc.collect()
    assert result() is None
