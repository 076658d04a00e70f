"""Cross entropy of affinities, beside counting pairs of pixels one by one."""

import math

import numpy as np
import pytest
import torch

from scenefw.core.part_views import PartViewBatch, PartViewSetup
from scenefw.losses.part_affinity import PartAffinityCrossEntropy, true_affinities


def pairs(owners):
    """(direction, row, column, same) of the pairs that count, found in a plain loop."""
    rows, columns = owners.shape
    for v in range(rows):
        for u in range(columns):
            for way, (y, x) in enumerate(((v, u + 1), (v + 1, u))):
                if y < rows and x < columns and (owners[v, u] or owners[y, x]):
                    yield way, v, u, owners[v, u] == owners[y, x]


@pytest.mark.parametrize("size", [(6, 7), (11, 4)])
def test_it_is_the_mean_over_inner_pairs_and_over_borders(size):
    rng = np.random.default_rng(0)
    owners = rng.integers(0, 3, size).repeat(2, axis=1).astype(np.int32)
    logits = rng.normal(size=(2, *owners.shape)).astype(np.float32)
    costs = {True: [], False: []}
    for way, v, u, same in pairs(owners):
        x = float(logits[way, v, u])
        costs[bool(same)].append(math.log1p(math.exp(-x if same else x)))
    batch = PartViewBatch(torch.zeros(1, *owners.shape), torch.from_numpy(owners)[None], None)
    loss = PartAffinityCrossEntropy()
    loss.check(PartViewSetup(8, 6, shown=False))
    found = float(loss(torch.from_numpy(logits)[None], batch))
    assert found == pytest.approx(np.mean(costs[True]) + np.mean(costs[False]), rel=1e-5)


def test_an_image_of_the_floor_costs_nothing():
    batch = PartViewBatch(torch.ones(1, 4, 5), torch.zeros(1, 4, 5, dtype=torch.int32), None)
    assert not true_affinities(batch.owners)[1].any()
    assert float(PartAffinityCrossEntropy()(torch.randn(1, 2, 4, 5), batch)) == 0.0
