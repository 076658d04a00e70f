"""What is tested on was not trained on: scenes and objects of the parts of the data."""

import hashlib
from itertools import combinations

import numpy as np
import pytest
from tests.unit.data.stacks_file import write_stacks

from scenefw.core.errors import ConfigError
from scenefw.core.final_split import opened
from scenefw.data.batches import stacks
from scenefw.data.batches.stacks import FINAL_PARTS, SHIPPED, StackScenes


def rows(*arrays):
    """Rows of arrays side by side, as a set that can be compared exactly."""
    return {row.tobytes() for row in np.concatenate([np.float32(a) for a in arrays], axis=1)}


def read(name, split):
    with opened():
        return StackScenes(name, split)


def scenes(name, split):
    found = read(name, split)
    p = found.parameters(list(range(len(found))))
    flat = (p.positions.flatten(1), p.rotations.flatten(1), p.half_axes.flatten(1))
    return set(found.indices.tolist()), rows(*flat)


def objects(name, split):
    found = read(name, split)
    p = found.parameters(list(range(len(found))))
    return rows(p.half_axes[p.present].numpy(), p.exponents[p.present].numpy())


def axes(name, split):
    """Half-axes alone, in any order."""
    found = read(name, split)
    p = found.parameters(list(range(len(found))))
    return rows(p.half_axes[p.present].sort(dim=1).values.numpy())


LEAST = {"stacks_v1": 400, "stacks_v2": 400, "wide_v2": 16}
"""Scenes, or objects, of a part."""


@pytest.mark.parametrize("name", SHIPPED)
def test_parts_of_shipped_data_share_no_scene(name):
    parts = stacks.SPLITS if name in FINAL_PARTS else stacks.SPLITS[:3]
    for first, second in combinations([scenes(name, split) for split in parts], 2):
        numbers, other_numbers = first[0], second[0]
        assert len(first[1]) >= LEAST.get(name, 200)
        assert len(first[1]) == len(numbers)
        assert not first[1] & second[1]
        if "final" not in parts:
            assert not numbers & other_numbers


@pytest.mark.parametrize("compared", [objects, axes])
def test_parts_of_shipped_data_share_no_object(compared):
    """Not even with one another: the tests of no data set show what another trains on."""
    parts = [set().union(*(compared(name, s) for name in FINAL_PARTS)) for s in stacks.SPLITS]
    for first, second in combinations(parts, 2):
        assert len(first) >= 200
        assert not first & second


def test_data_sets_v1_share_their_objects():
    """What they are kept for, weights of version 0.1, was trained so."""
    train, test = objects("stacks_v1", "train"), objects("stacks_v1", "test")
    assert len(train & test) > 0.99 * len(test)


@pytest.mark.parametrize("name", FINAL_PARTS)
def test_the_final_part_is_shut_and_has_a_seed_of_its_own(name):
    with pytest.raises(ConfigError, match="split=final"):
        StackScenes(name, "final")
    seeds = [read(name, split).manifest()["seed"] for split in ("test", "final")]
    assert seeds[0] != seeds[1]


def test_a_final_part_among_others_is_not_in_all(tmp_path):
    arrays = write_stacks(tmp_path / "a.npz")
    arrays["split"][3:5] = stacks.SPLITS.index("final")
    np.savez(tmp_path / "a.npz", **arrays)
    assert len(StackScenes(tmp_path / "a.npz", "all")) == len(arrays["split"]) - 2
    with pytest.raises(ConfigError, match="split=final"):
        StackScenes(tmp_path / "a.npz", "final")
    with opened() as looks:
        assert len(StackScenes(tmp_path / "a.npz", "final")) == 2
    assert looks == {"a": hashlib.sha256((tmp_path / "a.npz").read_bytes()).hexdigest()}
