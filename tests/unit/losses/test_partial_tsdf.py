from dataclasses import replace

import numpy as np
import pytest
from tests.unit.losses.volumes import random_pair

from scenefw.core.errors import ConfigError
from scenefw.losses.partial_tsdf import PartialTsdfLoss


@pytest.mark.parametrize("resolution", [3, 6])
def test_it_compares_with_the_distance_channel_of_the_condition(resolution):
    prediction, batch = random_pair(resolution)
    v = batch.condition[:, :1].numpy()
    error = np.abs(v - prediction.partial.detach().numpy())
    expected = np.mean(error / np.maximum(np.abs(v), 0.1))
    loss = PartialTsdfLoss(one_sided=False)(prediction, batch)
    assert float(loss) == pytest.approx(expected, rel=1e-5)


def test_a_network_without_reconstruction_is_an_error():
    prediction, batch = random_pair()
    with pytest.raises(ConfigError, match="partial_tsdf"):
        PartialTsdfLoss()(replace(prediction, partial=None), batch)
