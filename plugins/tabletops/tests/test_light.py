import numpy as np
import pytest
import torch

from scenefw.core.errors import ConfigError
from scenefw.core.rng import Streams
from scenefw_tabletops.data.light import ColourJitter


def test_light_by_hand():
    """Contrast about the mean of all three colours, then a factor for each."""
    image = torch.rand(2, 3, 4, 5, generator=torch.Generator().manual_seed(0))
    factors = np.array([[1.1, 0.9, 1.0, 1.2], [1, 1, 1, 1]], np.float32)
    found = ColourJitter().apply(image, torch.from_numpy(factors)).numpy()
    one = image[0].numpy().astype(np.float64)
    expected = ((one - one.mean()) * 1.2 + one.mean()) * np.array([1.1, 0.9, 1.0])[:, None, None]
    np.testing.assert_allclose(found[0], expected.clip(0, 1), atol=1e-6)
    np.testing.assert_allclose(found[1], image[1], atol=1e-6)


def test_factors_lie_where_they_are_said_to():
    streams = Streams.of(0, 1, indices=np.arange(4000))
    factors = ColourJitter(brightness=0.2, contrast=0.3, tint=0.05).draw(streams)
    gain, contrast = factors[:, :3], factors[:, 3]
    assert 0.7 <= contrast.min() < 0.71
    assert 1.29 < contrast.max() <= 1.3
    assert np.abs(gain.mean(axis=1) - 1).max() <= 0.2 + 0.05 * 1.2
    assert np.abs(gain.std(axis=0) - np.sqrt(0.2**2 / 3 + 0.05**2 / 3)).max() < 0.005
    assert abs(np.corrcoef(gain[:, 0], contrast)[0, 1]) < 0.05
    np.testing.assert_array_equal(factors[7], ColourJitter(0.2, 0.3, 0.05).draw(
        Streams.of(0, 1, indices=[7]))[0])  # fmt: skip
    assert (ColourJitter(0, 0, 0).draw(streams) == 1).all()


def test_settings():
    with pytest.raises(ConfigError, match=r"^brightness = 1\.0: expected 0 or more and below 1$"):
        ColourJitter(brightness=1.0)
