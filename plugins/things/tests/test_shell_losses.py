"""Losses of object shells, beside counting rays one by one."""

import math

import numpy as np
import pytest
import torch

from scenefw.core.errors import ConfigError
from scenefw_things.shells.batches import ObjectShellBatch, ShellPrediction, Shells, ShellSetup
from scenefw_things.shells.depth_loss import ShellDepth
from scenefw_things.shells.energy_loss import ShellEnergy
from scenefw_things.shells.mask_loss import ShellMask

COUNT, SIZE = 3, 5


def truth(seed=0):
    draws = torch.Generator().manual_seed(seed)
    depths = torch.rand(COUNT, 4, SIZE, SIZE, generator=draws)
    masks = torch.rand(2, COUNT, SIZE, SIZE, generator=draws) < 0.5
    scales = torch.tensor([0.1, 0.2, 0.4])
    return ObjectShellBatch(None, Shells(depths, masks[0], masks[0] & masks[1]), scales)


def said(seed, count=COUNT, draws=None):
    generator = torch.Generator().manual_seed(seed)
    masks = torch.randn(2, count, SIZE, SIZE, generator=generator)
    depths = torch.rand(count, 4, SIZE, SIZE, generator=generator)
    return ShellPrediction(masks[0], masks[1], depths, draws)


def rays(batch):
    for n, v, u in np.ndindex(COUNT, SIZE, SIZE):
        yield n, v, u, bool(batch.shells.amodal[n, v, u]), bool(batch.shells.hollow[n, v, u])


def entropy(logit, is_true):
    return math.log1p(math.exp(-float(logit) if is_true else float(logit)))


def test_masks_count_everywhere_and_hollows_on_the_object():
    batch, prediction = truth(), said(1)
    masks = [entropy(prediction.amodal[n, v, u], a) for n, v, u, a, _ in rays(batch)]
    hollows = [entropy(prediction.hollow[n, v, u], h) for n, v, u, a, h in rays(batch) if a]
    expected = np.mean(masks) + np.mean(hollows)
    assert float(ShellMask()(prediction, batch)) == pytest.approx(expected, rel=1e-5)


def test_depths_count_on_the_object_in_widths_of_the_crop():
    batch, prediction = truth(), said(1)
    total, count = 0.0, 0
    for n, v, u, amodal, hollow in rays(batch):
        errors = (prediction.depths - batch.shells.depths)[n, :, v, u].abs() / batch.scales[n]
        total += float(errors[:2].sum() if amodal else 0) + float(errors[2:].sum() if hollow else 0)
        count += amodal
    assert float(ShellDepth()(prediction, batch)) == pytest.approx(total / count, rel=1e-5)


def test_the_energy_score_is_least_where_draws_are_spread_as_the_truth_is():
    """The truth is one of two shells: drawing both at random is better than their mean."""
    a, b = said(1), said(2)
    middle = ShellPrediction(a.amodal, a.hollow, (a.depths + b.depths) / 2)

    def score(first, second):
        scores = []
        for true in (a, b):
            ones = torch.ones(COUNT, SIZE, SIZE, dtype=torch.bool)
            batch = ObjectShellBatch(None, Shells(true.depths, ones, ones), torch.ones(COUNT))
            scores.append(ShellEnergy()(said(3, draws=(first, second)), batch))
        return float(torch.stack(scores).mean())

    sure = ShellPrediction(torch.full_like(a.amodal, 20.0), a.hollow, a.depths)
    other = ShellPrediction(sure.amodal, a.hollow, b.depths)
    middle = ShellPrediction(sure.amodal, a.hollow, middle.depths)
    pairs = [(sure, sure), (other, other), (sure, other), (other, sure)]
    assert np.mean([score(*pair) for pair in pairs]) < score(middle, middle)


def test_the_energy_score_counts_the_first_crops_alone():
    batch, first, second = truth(), said(4, 2), said(5, 2)
    loss = float(ShellEnergy()(said(1, draws=(first, second)), batch))
    vectors = []
    shells = batch.shells
    for depths, mask in (
        (first.depths, first.amodal.sigmoid()), (second.depths, second.amodal.sigmoid()),
        (shells.depths[:2], shells.amodal[:2].float()),
    ):  # fmt: skip
        ends = depths[:, :2] / batch.scales[:2, None, None, None] * shells.amodal[:2, None]
        vectors.append(torch.cat([ends, mask[:, None]], 1).flatten(1))
    a, b, t = vectors
    rms = [(x - y).square().mean(1).sqrt() for x, y in ((a, t), (b, t), (a, b))]
    expected = float((0.5 * (rms[0] + rms[1] - rms[2])).mean())
    assert loss == pytest.approx(expected, abs=1e-4)
    assert float(ShellEnergy()(said(1), batch)) == 0.0


def test_an_energy_score_needs_draws():
    ShellEnergy().check(ShellSetup(2))
    with pytest.raises(ConfigError, match=r"model\.drawn"):
        ShellEnergy().check(ShellSetup(0))
