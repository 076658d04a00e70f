"""The repertoire: ranges, kinds of shapes, reproducibility."""

import numpy as np
import pytest

from scenefw.core.errors import ConfigError
from scenefw_simulators.generation.library import SuperquadricLibrary


def parameters(library):
    shapes = [library[i] for i in range(len(library))]
    return np.array([s.half_axes for s in shapes]), np.array([s.exponents for s in shapes])


def test_ranges_and_kinds():
    half_axes, exponents = parameters(SuperquadricLibrary(size=800))
    assert half_axes.min() >= 0.025 - 1e-8
    assert half_axes.max() <= 0.15 + 1e-8
    assert exponents.min() >= 2 - 1e-6
    assert exponents.max() <= 100 + 1e-4
    kinds = np.array([len(set(row)) for row in exponents])
    assert 0.4 < (kinds == 2).mean() < 0.6
    assert 0.4 < (kinds == 3).mean() < 0.6
    # Log-uniform: half lies below the geometric mean of the limits.
    assert 0.45 < (exponents < np.sqrt(200)).mean() < 0.55


def test_depends_on_the_seed_alone():
    one, two = SuperquadricLibrary(size=5, seed=3), SuperquadricLibrary(size=5, seed=3)
    for a, b in zip(parameters(one), parameters(two), strict=True):
        np.testing.assert_array_equal(a, b)
    assert not np.array_equal(
        parameters(one)[0], parameters(SuperquadricLibrary(size=5, seed=0))[0]
    )


def test_parameters_are_exact_in_single_precision():
    for array in parameters(SuperquadricLibrary(size=20)):
        np.testing.assert_array_equal(array, array.astype(np.float32))


def test_sample_draws_from_the_library():
    library = SuperquadricLibrary(size=4)
    rng = np.random.default_rng(0)
    drawn = {tuple(library.sample(rng).half_axes) for _ in range(60)}
    assert drawn == {tuple(library[i].half_axes) for i in range(4)}


@pytest.mark.parametrize(
    "wrong", [{"size": 0}, {"extents": (0.3, 0.05)}, {"exponents": (0.5, 2.0)}]
)
def test_bad_settings(wrong):
    with pytest.raises(ConfigError, match=f"{next(iter(wrong))} = "):
        SuperquadricLibrary(**wrong)
