from hypothesis import given
from hypothesis import strategies as st

from scenefw.core import rng

numbers = st.integers(0, 2**31)


@given(numbers, numbers)
def test_a_stream_depends_on_seed_and_number_alone(seed, index):
    assert rng.generator(seed, index).random() == rng.generator(seed, index).random()
    assert rng.torch_seed(seed, index) == rng.torch_seed(seed, index)


@given(numbers, st.lists(numbers, min_size=2, max_size=2, unique=True))
def test_streams_differ(seed, pair):
    first, second = pair
    assert rng.generator(seed, first).random() != rng.generator(seed, second).random()
    assert rng.generator(first, seed).random() != rng.generator(second, seed).random()
    assert rng.torch_seed(seed, first) != rng.torch_seed(seed, second)


@given(numbers)
def test_torch_seeds_fit_a_signed_integer(seed):
    assert 0 <= rng.torch_seed(seed, 3) < 2**63
