import numpy as np
import pytest

from scenefw.core.errors import InputError
from scenefw_scene_prior.sampler import Sampler


class Asked:
    """A prior that tells what it is asked for."""

    def scenes(self, count, seed):
        self.asked = (count, seed)
        return iter(())


def test_the_prior_draws_what_is_asked_for():
    prior = Asked()
    assert Sampler(prior).draw(np.int64(2), seed=3) == []
    assert prior.asked == (2, 3)


@pytest.mark.parametrize("count", ["a", -1, 0, 2.5, True, None])
def test_a_count_is_a_whole_number_from_one_on(count):
    with pytest.raises(InputError, match=r"^count is .*; expected a whole number, 1 or more$"):
        Sampler(Asked()).draw(count)


@pytest.mark.parametrize("seed", ["a", -1, 2.5, None])
def test_a_seed_is_a_whole_number(seed):
    with pytest.raises(InputError, match=r"^seed is .*; expected a whole number, 0 or more$"):
        Sampler(Asked()).draw(1, seed)
