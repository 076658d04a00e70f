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
