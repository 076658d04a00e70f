import numpy as np
import pytest

from scenefw.core import rng as streams
from scenefw.core.errors import ConfigError
from scenefw.shapes.solid_mesh import closed
from scenefw_single_view_benchmarks.random_solids import RandomSolids

pytest.importorskip("pybullet_data")


def test_shapes_are_closed_and_as_long_as_they_may_be():
    library = RandomSolids(sizes=(0.05, 0.2), vessel_ratio=0.5)
    shapes = [library.sample(streams.generator(0, i)) for i in range(12)]
    names = [shape.name for shape in shapes]
    assert any(name.startswith("vessel") for name in names)
    assert any(name.endswith("mm") for name in names)
    for shape in shapes:
        assert closed(shape.mesh())
        assert shape.volume() > 0
        if shape.name.endswith("mm"):
            assert 0.049 < np.ptp(shape.vertices, axis=0).max() < 0.201


def test_the_same_number_is_the_same_shape():
    first, again = (RandomSolids().sample(streams.generator(3), "val") for _ in range(2))
    assert first.name == again.name
    np.testing.assert_array_equal(first.vertices, again.vertices)
    np.testing.assert_array_equal(first.vertices, first.vertices.astype(np.float32))


def test_sizes_must_be_a_range():
    with pytest.raises(ConfigError, match=r"shape\.sizes"):
        RandomSolids(sizes=(0.2, 0.1))
