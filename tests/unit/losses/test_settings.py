"""Settings that would make a loss or its gradient infinite are found where they are given."""

import pytest

from scenefw.core.errors import ConfigError
from scenefw.losses.partial_tsdf import PartialTsdfLoss
from scenefw.losses.tsdf import TsdfLoss
from scenefw.losses.votes import VoteLoss


@pytest.mark.parametrize(
    ("loss", "wrong", "name"),
    [
        (TsdfLoss, {"floor": 0.0}, "floor = 0.0"),
        (PartialTsdfLoss, {"floor": -0.1}, "floor = -0.1"),
        (VoteLoss, {"epsilon": 0.0}, "epsilon = 0.0"),
        (VoteLoss, {"object_share": 2.0}, "object_share = 2.0"),
    ],
)
def test_it_is_one_line_that_names_the_setting(loss, wrong, name):
    with pytest.raises(ConfigError, match=name) as caught:
        loss(**wrong)
    assert "\n" not in str(caught.value)
