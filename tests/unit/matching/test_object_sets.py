import itertools

import pytest
import torch
from torch.nn.functional import binary_cross_entropy_with_logits

from scenefw.matching.object_sets import matched_objects, sums_inside


def scenes(slots, count, seed=0, resolution=4):
    """Logits, labels and presence of two scenes; the second lacks its last object."""
    generator = torch.Generator().manual_seed(seed)
    size = (2, *(resolution,) * 3)
    logits = 3 * torch.randn(2, slots, *size[1:], generator=generator)
    instances = torch.randint(0, count + 1, size, generator=generator)
    instances[1][instances[1] == count] = 0
    present = torch.ones(2, count, dtype=torch.bool)
    present[1, -1] = False
    return logits, instances.int(), present


def cross_entropy(logits, instances, scene, slot, target):
    """Of one prediction and one object, or nothing."""
    truth = (instances[scene] == target + 1).float() if target >= 0 else torch.zeros(4, 4, 4)
    return float(binary_cross_entropy_with_logits(logits[scene, slot], truth))


def total(logits, instances, scene, targets):
    pairs = enumerate(targets)
    return sum(cross_entropy(logits, instances, scene, slot, target) for slot, target in pairs)


def test_sums_are_those_of_every_pair():
    logits, instances, _ = scenes(3, 2)
    sums = sums_inside(logits, instances, 2)
    for scene, slot, i in itertools.product(range(2), range(3), range(2)):
        inside = instances[scene] == i + 1
        assert float(sums[scene, slot, i]) == pytest.approx(
            float(logits[scene, slot][inside].sum())
        )


@pytest.mark.parametrize(("slots", "count"), [(4, 3), (3, 3), (2, 3)])
@pytest.mark.parametrize("seed", [0, 1])
def test_no_other_matching_has_less_cross_entropy(slots, count, seed):
    """Every way to give objects, or nothing, to predictions is tried."""
    logits, instances, present = scenes(slots, count, seed)
    matched = matched_objects(logits, instances, present)
    for scene in range(2):
        given = [*range(int(present[scene].sum()))]
        given += [-1] * max(slots - len(given), 0)
        least = min(
            total(logits, instances, scene, order) for order in itertools.permutations(given, slots)
        )
        found = total(logits, instances, scene, matched[scene].tolist())
        assert found == pytest.approx(least, abs=1e-6)
        objects = [i for i in matched[scene].tolist() if i >= 0]
        assert len(set(objects)) == len(objects) == min(slots, int(present[scene].sum()))


def test_no_gradient_passes_and_a_diverged_network_raises_nothing():
    logits, instances, present = scenes(3, 2)
    matched = matched_objects(logits.requires_grad_(), instances, present)
    assert not matched.requires_grad
    broken = matched_objects(torch.full_like(logits, torch.nan), instances, present)
    assert sorted(broken[0].tolist()) == [-1, 0, 1]


def test_an_empty_scene_matches_nothing():
    logits, instances, present = scenes(3, 2)
    found = matched_objects(logits, torch.zeros_like(instances), torch.zeros_like(present))
    assert found.tolist() == [[-1] * 3] * 2


def test_of_equal_shapes_the_nearer_prediction_is_taken():
    instances = torch.zeros(1, 4, 4, 4, dtype=torch.int32)
    instances[0, :2], instances[0, 2:] = 1, 2
    present = torch.ones(1, 2, dtype=torch.bool)
    logits = torch.zeros(1, 3, 4, 4, 4)
    distances = torch.tensor([[[0.9, 0.1], [0.5, 0.5], [0.2, 0.8]]])
    assert matched_objects(logits, instances, present, centre_distances=distances).tolist() == [
        [1, -1, 0]
    ]
    logits[0, 1, :2] = 20.0  # shapes count more than half a metre of distance
    assert matched_objects(logits, instances, present, centre_distances=distances).tolist() == [
        [1, 0, -1]
    ]
