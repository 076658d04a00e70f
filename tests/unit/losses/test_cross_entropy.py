import math

import pytest
import torch

from scenefw.core.batches import SegmentationBatch
from scenefw.core.errors import ConfigError
from scenefw.losses.cross_entropy import CrossEntropy


def batch(labels):
    labels = torch.tensor(labels)
    return SegmentationBatch(torch.zeros(1), torch.zeros(1), labels)


def test_by_hand_with_weights_and_unknown_pixels():
    logits = torch.tensor([[[[2.0, 0.0, 9.0]], [[0.0, 1.0, -9.0]]]])  # (1, 2, 1, 3)
    first, second = math.log(1 + math.exp(-2)), math.log(1 + math.exp(-1))
    plain = CrossEntropy()(logits, batch([[[0, 1, -1]]]))
    assert float(plain) == pytest.approx((first + second) / 2, rel=1e-5)
    weighted = CrossEntropy(class_weights=[1, 3])(logits, batch([[[0, 1, -1]]]))
    assert float(weighted) == pytest.approx((first + 3 * second) / 4, rel=1e-5)


def test_it_is_torchs_mean():
    generator = torch.Generator().manual_seed(0)
    logits = torch.randn(2, 4, 5, 6, generator=generator)
    labels = torch.randint(-1, 4, (2, 5, 6), generator=generator)
    weights = [0.2, 1.0, 2.0, 1.0]
    expected = torch.nn.functional.cross_entropy(
        logits, labels, torch.tensor(weights), ignore_index=-1, label_smoothing=0.1
    )
    found = CrossEntropy(class_weights=weights, smoothing=0.1)(
        logits, SegmentationBatch(logits, logits, labels)
    )
    torch.testing.assert_close(found, expected)


def test_nothing_known_is_nothing_lost():
    logits = torch.randn(1, 2, 1, 2, requires_grad=True)
    loss = CrossEntropy()(logits, batch([[[-1, -1]]]))
    loss.backward()
    assert float(loss.detach()) == 0
    assert torch.equal(logits.grad, torch.zeros_like(logits))


def test_a_weight_per_class():
    with pytest.raises(ConfigError, match="3 numbers"):
        CrossEntropy(class_weights=[1, 1, 1])(torch.zeros(1, 2, 1, 1), batch([[[0]]]))
    with pytest.raises(ConfigError, match="smoothing"):
        CrossEntropy(smoothing=1.0)
