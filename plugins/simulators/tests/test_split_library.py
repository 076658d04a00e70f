"""The repertoire of data sets v2: families, and parts that share no shape."""

from itertools import combinations

import numpy as np
import pytest

from scenefw.core.errors import ConfigError
from scenefw_simulators.generation.split_library import SplitLibrary

FAMILIES = {
    "block": {"share": 2.0, "extents": [[0.2, 0.3]] * 3},
    "flat": {"share": 1.0, "extents": [[0.1, 0.15], [0.1, 0.15], [0.01, 0.02]]},
}
SIZES = {"train": 600, "val": 40, "test": 40, "final": 40}


def library(**settings):
    return SplitLibrary(**{"families": FAMILIES, "sizes": SIZES, **settings})


def shapes(found, part):
    return [(*shape.half_axes, *shape.exponents) for shape in found.part(part)]


def test_parts_have_their_sizes_and_share_no_shape():
    found = library()
    parts = {part: set(shapes(found, part)) for part in SIZES}
    assert {part: len(part_) for part, part_ in parts.items()} == SIZES
    for first, second in combinations(parts.values(), 2):
        assert not first & second


def test_every_part_has_every_family_in_its_share():
    for part in SIZES:
        extents = 2 * np.array(shapes(library(), part))[:, :3]
        flat = extents[:, 2] < 0.05
        assert 0.1 < flat.mean() < 0.6
        assert (extents[flat] <= [0.15, 0.15, 0.02]).all()
        assert (extents[~flat] >= 0.2 - 1e-8).all()
    extents = 2 * np.array(shapes(library(), "train"))[:, :3]
    assert (extents[:, 2] < 0.05).mean() == pytest.approx(1 / 3, abs=0.06)


def test_a_part_depends_on_the_seed_and_not_on_the_sizes_of_others():
    few = library(sizes={"val": 40, "train": 2})
    assert shapes(few, "val") == shapes(library(), "val")
    assert shapes(library(seed=1), "val") != shapes(library(), "val")


def test_samples_are_of_the_part():
    found, rng = library(), np.random.default_rng(0)
    own = set(shapes(found, "final"))
    drawn = {(*s.half_axes, *s.exponents) for s in (found.sample(rng, "final") for _ in range(400))}
    assert drawn == own


def test_parameters_are_exact_in_single_precision():
    numbers = np.array(shapes(library(), "test"))
    np.testing.assert_array_equal(numbers, numbers.astype(np.float32))


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"families": {}}, "shape.families"),
        ({"families": {"a": {"share": -1, "extents": [[1, 2]] * 3}, **FAMILIES}}, "a.share"),
        ({"families": {"a": {"share": 1, "extents": [[1, 2]] * 2}}}, "a.extents"),
        ({"families": {"a": {"share": 1, "extents": [[0.2, 0.1]] * 3}}}, "a.extents"),
        ({"sizes": {"train": 0}}, "sizes.train"),
        ({"sizes": {"training": 5}}, "sizes.training"),
        ({"exponents": (0.5, 2.0)}, "shape.exponents"),
    ],
)
def test_bad_settings(wrong, named):
    with pytest.raises(ConfigError, match=named):
        library(**wrong)


def test_a_missing_part_is_named():
    with pytest.raises(ConfigError, match=r"shape\.sizes\.final"):
        library(sizes={"train": 3}).sample(np.random.default_rng(0), "final")
