import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from scenefw.core import rng

numbers = st.integers(0, 2**31)


@given(numbers, st.lists(numbers, max_size=3))
def test_streams_are_those_that_numpy_spawns(seed, stream):
    """Data sets are told by their seeds: another generator would be other data."""
    expected = np.random.SeedSequence(seed, spawn_key=stream)
    ours, theirs = rng.generator(seed, *stream), np.random.Generator(np.random.PCG64(expected))
    assert ours.random(3).tolist() == theirs.random(3).tolist()
    (word,) = np.random.SeedSequence(seed, spawn_key=stream).generate_state(1, np.uint64)
    assert rng.torch_seed(seed, *stream) == int(word) // 2


def test_streams_stay_what_they_were():
    drawn = rng.generator(7, 1, 2).integers(2**63 - 1, size=2)
    assert drawn.tolist() == [4417028105319979876, 1302322531125184220]
    assert rng.torch_seed(7, 1, 2) == 5274635825266628681
    keys = rng.Streams.of(7, 2, indices=[0, 5]).keys
    assert keys.tolist() == [6325400318320623387, 12502797309547234021]


def test_numbers_of_names_are_their_check_sums():
    assert rng.number_of("123456789") == 0xCBF43926  # the published check value of CRC-32
    assert rng.number_of("") == 0


@given(numbers, st.lists(numbers, min_size=2, max_size=2, unique=True))
def test_streams_differ(seed, pair):
    first, second = pair
    assert rng.generator(seed, first).random() != rng.generator(seed, second).random()
    assert rng.generator(first, seed).random() != rng.generator(second, seed).random()
    assert rng.torch_seed(seed, first) != rng.torch_seed(seed, second)


def test_torch_seeds_fill_the_positive_signed_integers():
    seeds = [rng.torch_seed(seed, 3) for seed in range(1000)]
    assert min(seeds) >= 0
    assert 2**62 < max(seeds) < 2**63


def splitmix(state, count):
    """Steele, Lea and Flood's generator in whole numbers."""
    words, mask = [], 2**64 - 1
    for _ in range(count):
        state = (state + 0x9E3779B97F4A7C15) & mask
        z = ((state ^ (state >> 30)) * 0xBF58476D1CE4E5B9) & mask
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & mask
        words.append(z ^ (z >> 31))
    return words


@given(st.integers(0, 2**64 - 1))
def test_streams_are_those_of_splitmix(key):
    streams = rng.Streams(np.array([5, key], np.uint64))
    expected = [(word >> 11) * 2.0**-53 for word in splitmix(key, 6)]
    assert streams.uniform(6)[1].tolist() == expected
    assert streams.uniform(2, start=3)[1].tolist() == expected[3:5]
    assert streams.seeds(6)[1].tolist() == [word >> 1 for word in splitmix(key, 6)]


def test_splitmix_gives_the_published_numbers():
    published = [6457827717110365317, 3203168211198807973, 9817491932198370423]
    assert splitmix(1234567, 3) == published


@given(numbers, st.lists(numbers, min_size=2, max_size=8, unique=True))
def test_a_stream_does_not_depend_on_those_beside_it(seed, indices):
    together = rng.Streams.of(seed, 2, indices=indices)
    for row, index in enumerate(indices):
        alone = rng.Streams.of(seed, 2, indices=[index])
        assert alone.uniform(3)[0].tolist() == together.uniform(3)[row].tolist()
        for mine, others in zip(alone.split(2), together.split(2), strict=True):
            assert mine.keys[0] == others.keys[row]
    assert len(np.unique(together.keys)) == len(indices)
    assert (together.keys != rng.Streams.of(seed, 3, indices=indices).keys).all()


def test_streams_and_their_draws_are_uniform_and_independent():
    streams = rng.Streams.of(0, 2, indices=np.arange(20_000))
    first, second = streams.split(2)
    columns = [streams.uniform(2), first.uniform(1), second.uniform(1)]
    draws = np.concatenate(columns, axis=1).T
    for column in draws:
        assert stats.kstest(column, "uniform").pvalue > 1e-3
    neighbours = [np.corrcoef(column[:-1], column[1:])[0, 1] for column in draws]
    between = np.corrcoef(draws)[np.triu_indices(4, 1)]
    assert np.abs([*neighbours, *between]).max() < 4 / np.sqrt(20_000)
    assert (streams.seeds(3) >= 0).all()
