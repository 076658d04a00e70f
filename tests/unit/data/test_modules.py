import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.unit.data.stacks_file import write_stacks

from scenefw.core.errors import ConfigError
from scenefw.data.modules import EpochBatches, StackData


@given(scenes=st.integers(4, 60), size=st.integers(1, 4), epoch=st.integers(0, 5))
def test_an_epoch_takes_every_scene_once(scenes, size, epoch):
    batches = EpochBatches(scenes, size, seed=3)
    made = [batches.batch(epoch * len(batches) + i) for i in range(len(batches))]
    taken = np.concatenate([b.indices for b in made])
    assert len(taken) == scenes // size * size
    assert len(set(taken.tolist())) == len(taken)
    assert all(b.epoch == epoch for b in made)
    assert set(taken.tolist()) <= set(range(scenes))


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


def test_batch_larger_than_the_data_is_refused():
    with pytest.raises(ConfigError, match="batch_size"):
        EpochBatches(3, 4, seed=0)


def test_stack_data_keeps_splits_apart(tmp_path):
    write_stacks(tmp_path / "stacks.npz")
    data = StackData(str(tmp_path / "stacks.npz"), limit=6, validation_limit=2, batch_size=3)
    assert len(data.train_dataloader()) == 2
    assert [b.indices.tolist() for b in data.val_dataloader()] == [[0, 1]]
    assert not set(data.scenes.indices) & set(data.validation_scenes.indices)


def test_a_few_batches_come_again_as_they_were():
    every, few = EpochBatches(20, 5, seed=3), EpochBatches(20, 5, seed=3, distinct=2)
    for number in range(9):
        expected, found = every.batch(number % 2), few.batch(number)
        assert found.epoch == 0
        assert found.indices.tolist() == expected.indices.tolist()
    assert few.batch(0).indices.tolist() != few.batch(1).indices.tolist()
    assert len(few) == len(every)


def test_no_distinct_batch_is_refused():
    with pytest.raises(ConfigError, match="distinct_batches is 0"):
        EpochBatches(20, 5, seed=3, distinct=0)
