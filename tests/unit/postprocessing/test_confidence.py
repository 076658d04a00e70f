import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from scenefw.core.errors import ConfigError
from scenefw.postprocessing.confidence import Calibration, confidences

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


@given(
    st.lists(st.tuples(st.floats(0, 1), st.floats(0, 1)), min_size=1, max_size=80),
    st.lists(st.floats(0, 1), min_size=2, max_size=5),
)
def test_more_agreement_never_means_less_confidence(pairs, asked):
    said, truth = np.array(pairs).T
    found = Calibration.fitted(said, truth)(np.sort(asked))
    assert (np.diff(found) >= 0).all()
    assert (found >= truth.min() - 1e-9).all()
    assert (found <= truth.max() + 1e-9).all()


def test_a_calibration_finds_the_curve_that_made_the_truth():
    random = np.random.default_rng(0)
    said = random.uniform(0, 1, 4000)
    truth = (said**2 + random.normal(0, 0.02, 4000)).clip(0, 1)
    asked = np.linspace(0.1, 0.9, 9)
    assert Calibration.fitted(said, truth)(asked) == pytest.approx(asked**2, abs=0.03)


def test_confidences_are_calibrated():
    labels, sample = np.zeros((4, 4, 4), int), np.zeros((4, 4, 4), int)
    labels[:2], sample[:1] = 1, 1
    volumes = torch.from_numpy(labels), [torch.from_numpy(sample)]
    assert confidences(*volumes) == {1: pytest.approx(0.5)}
    assert confidences(*volumes, Calibration([0.0, 1.0], [0.2, 1.0])) == {1: pytest.approx(0.6)}


@pytest.mark.parametrize(
    ("said", "expected"),
    [([], []), ([0.5], [0.1, 0.2]), ([0.5, 0.4], [0.1, 0.2]), ([0.1, 0.2], [0.5, 0.4]),
     ([0.1, 1.2], [0.5, 0.6]), ([0.1], [float("nan")])],
)  # fmt: skip
def test_calibrations_that_mean_nothing_are_refused(said, expected):
    with pytest.raises(ConfigError, match="said"):
        Calibration(said, expected)
