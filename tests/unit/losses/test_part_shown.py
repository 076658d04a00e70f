"""Cross entropy of pixels that show objects, beside the definition."""

import numpy as np
import pytest
import torch

from scenefw.core.errors import ConfigError
from scenefw.core.part_views import PartViewBatch, PartViewSetup
from scenefw.losses.part_shown import PartShownCrossEntropy


@pytest.mark.parametrize("size", [(6, 7), (11, 4)])
def test_it_is_the_mean_over_objects_and_over_the_rest(size):
    rng = np.random.default_rng(0)
    owners, depth = rng.integers(0, 3, size), rng.integers(0, 2, size) * 0.8
    logits = rng.normal(size=(3, *size))
    said = 1 / (1 + np.exp(-logits[2]))
    objects, others = (owners > 0) & (depth > 0), (owners == 0) & (depth > 0)
    true = -np.log(said[objects]).mean() - np.log(1 - said[others]).mean()
    batch = PartViewBatch(
        torch.from_numpy(depth)[None].float(), torch.from_numpy(owners)[None].int(), None
    )
    loss = PartShownCrossEntropy()
    found = float(loss(torch.from_numpy(logits)[None].float(), batch))
    assert found == pytest.approx(true, rel=1e-5)
    changed = torch.from_numpy(logits)[None].float()
    changed[:, :2] += 1
    changed[:, 2][batch.depth == 0] = 50.0
    assert float(loss(changed, batch)) == pytest.approx(found)


@pytest.mark.parametrize("size", [(6, 7), (11, 4)])
def test_obstacles_are_a_second_term(size):
    rng = np.random.default_rng(1)
    owners, depth = rng.integers(0, 4, size), rng.integers(0, 2, size) * 0.8
    logits, is_obstacle = rng.normal(size=(4, *size)), owners == 3
    true = 0.0
    for row, target in ((2, (owners > 0) & ~is_obstacle), (3, is_obstacle)):
        said = 1 / (1 + np.exp(-logits[row]))
        true -= np.log(said[target & (depth > 0)]).mean()
        true -= np.log(1 - said[~target & (depth > 0)]).mean()
    batch = PartViewBatch(
        torch.from_numpy(depth)[None].float(),
        torch.from_numpy(owners)[None].int(),
        None,
        torch.from_numpy(is_obstacle)[None],
    )
    cost = float(PartShownCrossEntropy()(torch.from_numpy(logits)[None].float(), batch))
    assert cost == pytest.approx(true, rel=1e-5)


def test_a_network_that_does_not_say_it_gets_one_line():
    loss = PartShownCrossEntropy()
    loss.check(PartViewSetup(8, 6, shown=True))
    with pytest.raises(ConfigError, match=r"model\.shown=true"):
        loss.check(PartViewSetup(8, 6, shown=False))
