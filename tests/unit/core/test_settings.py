"""Ranges of settings: what is in them, and the one line for what is not."""

import math
import pickle

import pytest

from scenefw.core.errors import ConfigError, SettingError
from scenefw.core.settings import (
    COUNT,
    NOT_NEGATIVE,
    PART,
    POSITIVE,
    PROBABILITY,
    SHARE,
    above,
    at_least,
    below,
    between,
)


@pytest.mark.parametrize(("allowed", "inside", "outside"), [
    (POSITIVE, (1e-9, 5), (0, -1, math.nan)),
    (NOT_NEGATIVE, (0, 5), (-1e-9, math.nan)),
    (COUNT, (1, 7), (0, 0.5, -3, math.nan)),
    (SHARE, (0, 0.5, 1), (-0.1, 1.1, math.nan)),
    (PART, (0.1, 1), (0, 1.1, math.nan)),
    (PROBABILITY, (0.1, 0.9), (0, 1, math.nan)),
    (at_least(4), (4, 5), (3, math.nan)),
    (below(1), (0, 0.9), (-0.1, 1, math.nan)),
    (between(2, 3), (2, 3), (1.9, 3.1, math.nan)),
    (above(2, "as of the other"), (2.1,), (2, 1, math.nan)),
])  # fmt: skip
def test_ranges_hold_what_they_say(allowed, inside, outside):
    allowed.require(**{f"n{i}": value for i, value in enumerate(inside)}, off=None)
    allowed.require(all=inside)
    for value in outside:
        with pytest.raises(SettingError):
            allowed.require(own=value)
        with pytest.raises(SettingError):
            allowed.require(own=[*inside, value])


def test_the_message_names_the_wrong_one_alone():
    with pytest.raises(ConfigError) as error:
        SHARE.require(right=0.3, wrong=1.5, also=0.4)
    assert str(error.value) == "wrong = 1.5: expected a share from 0 to 1"


def test_the_message_shows_all_members_of_a_list():
    with pytest.raises(ConfigError) as error:
        POSITIVE.require(size=(3, 0))
    assert str(error.value) == "size = [3, 0]: expected more than 0"


def test_the_error_comes_back_from_another_process_unchanged():
    error = SettingError("a", 3, "less")
    assert str(pickle.loads(pickle.dumps(error))) == str(error) == "a = 3: expected less"
