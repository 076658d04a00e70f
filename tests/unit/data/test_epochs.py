import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenefw.core.errors import ConfigError
from scenefw.data.epochs import EpochBatches


@given(scenes=st.integers(4, 60), size=st.integers(1, 4), epoch=st.integers(0, 5))
def test_an_epoch_takes_every_scene_once(scenes, size, epoch):
    batches = EpochBatches(scenes, size, seed=3)
    made = [batches.batch(epoch * len(batches) + i) for i in range(len(batches))]
    taken = np.concatenate([b.indices for b in made])
    assert len(taken) == scenes // size * size
    assert len(set(taken.tolist())) == len(taken)
    assert all(b.epoch == epoch for b in made)
    assert set(taken.tolist()) <= set(range(scenes))


@pytest.mark.parametrize("epoch", [0, 3])
def test_the_order_of_an_epoch_is_a_permutation_of_its_own_stream(epoch):
    batches = EpochBatches(11, 3, seed=5)
    order = np.random.default_rng(np.random.SeedSequence(5, spawn_key=(1, epoch))).permutation(11)
    for position in range(3):
        found = batches.batch(3 * epoch + position).indices.tolist()
        assert found == order[3 * position : 3 * position + 3].tolist()


def test_a_few_batches_come_again_as_they_were():
    """Their epoch too, as views are drawn by it."""
    few, plain = EpochBatches(8, 2, 0, distinct=5), EpochBatches(8, 2, 0)
    made = [few.batch(number) for number in range(12)]
    for number, batch in enumerate(made):
        first = plain.batch(number % 5)
        assert (batch.epoch, batch.indices.tolist()) == (first.epoch, first.indices.tolist())
    assert [batch.epoch for batch in made[:6]] == [0, 0, 0, 0, 1, 0]
    with pytest.raises(ConfigError, match=r"distinct_batches = 0"):
        EpochBatches(8, 2, 0, distinct=0)


def test_order_depends_on_seed_and_epoch():
    def order(seed, epoch):
        batches = EpochBatches(40, 4, seed)
        return [batches.batch(epoch * 10 + i).indices.tolist() for i in range(10)]

    assert order(0, 1) == order(0, 1)
    assert order(0, 1) != order(0, 2)
    assert order(0, 1) != order(1, 1)


def test_validation_keeps_order_and_the_last_batch():
    batches = list(EpochBatches(5, 2, seed=None))
    assert [b.indices.tolist() for b in batches] == [[0, 1], [2, 3], [4]]


def test_processes_share_an_epoch():
    parts = [EpochBatches(21, 5, 0, rank, 2) for rank in range(2)]
    assert len(parts[0]) == len(parts[1]) == 2
    taken = [i for p in parts for b in p for i in b.indices.tolist()]
    assert len(taken) == len(set(taken)) == 20
    alone = EpochBatches(21, 21, 0).batch(0).indices.tolist()
    for rank, part in enumerate(parts):
        own = [i for batch in part for i in batch.indices.tolist()]
        assert own == alone[rank::2][:10]


def test_processes_validate_every_sample_once():
    parts = [EpochBatches(5, 2, None, rank, 2) for rank in range(2)]
    taken = [[b.indices.tolist() for b in part] for part in parts]
    assert taken == [[[0, 2], [4]], [[1, 3]]]


def test_batch_larger_than_the_data_is_refused():
    with pytest.raises(ConfigError, match="batch_size"):
        EpochBatches(3, 4, seed=0)


def test_the_message_says_how_large_a_batch_may_be():
    with pytest.raises(ConfigError, match=r"batch_size = 9: expected 1 to 5, .* of 2 processes"):
        EpochBatches(10, 9, seed=0, world=2)
