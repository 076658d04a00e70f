import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from scenefw.postprocessing.confidence import confidences

labellings = arrays.arrays(np.int32, (4, 4, 4), elements=st.integers(0, 4))


def brute_force(instances, samples):
    found = {}
    for i in np.unique(instances[instances > 0]):
        agreements = []
        for sample in samples:
            ious = [
                np.sum((instances == i) & (sample == j)) / np.sum((instances == i) | (sample == j))
                for j in np.unique(sample[sample > 0])
            ]
            agreements.append(max(ious, default=0.0))
        found[int(i)] = float(np.mean(agreements))
    return found


@given(labellings, st.lists(labellings, min_size=1, max_size=3))
def test_equals_brute_force(instances, samples):
    found = confidences(torch.from_numpy(instances), [torch.from_numpy(s) for s in samples])
    expected = brute_force(instances, samples)
    assert found.keys() == expected.keys()
    for label, value in expected.items():
        assert found[label] == pytest.approx(value)


@given(labellings)
def test_the_same_objects_under_other_numbers_are_certain(instances):
    renumbered = np.array([0, 7, 3, 9, 1])[instances]
    found = confidences(torch.from_numpy(instances), [torch.from_numpy(renumbered)])
    assert all(value == 1.0 for value in found.values())


def test_an_object_in_half_of_the_samples_is_half_certain():
    one = torch.zeros(4, 4, 4, dtype=torch.int32)
    one[:2] = 1
    assert confidences(one, [one, torch.zeros_like(one)]) == {1: 0.5}


def test_without_samples_all_is_certain():
    assert confidences(torch.tensor([[[0, 2, 5]]]), []) == {2: 1.0, 5: 1.0}
