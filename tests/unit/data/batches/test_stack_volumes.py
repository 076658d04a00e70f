import pytest
import torch
from tests.unit.data.stacks_file import write_stacks
from tests.unit.learning import tiny

from scenefw.core.batches import IndexBatch
from scenefw.core.errors import ConfigError

CPU = torch.device("cpu")


@pytest.fixture
def stacks(tmp_path):
    write_stacks(tmp_path / "stacks.npz")
    return tmp_path / "stacks.npz"


def test_stack_data_keeps_splits_apart(stacks):
    data = tiny.data(stacks, limit=6, validation_limit=2, batch_size=3)
    assert len(data.train_dataloader()) == 2
    assert [b.indices.tolist() for b in data.val_dataloader()] == [[0, 1]]
    assert not set(data.scenes.indices) & set(data.validation_scenes.indices)


@pytest.mark.parametrize("resolution", [8, 16])
def test_a_scene_of_an_epoch_is_the_same_in_any_batch(stacks, resolution):
    data = tiny.data(stacks, resolution)
    both = data.training_batch(IndexBatch(3, torch.tensor([0, 1])), CPU)
    one = data.training_batch(IndexBatch(3, torch.tensor([1])), CPU)
    later = data.training_batch(IndexBatch(4, torch.tensor([1])), CPU)
    assert torch.equal(both.condition[1:], one.condition)
    assert torch.equal(both.tsdf[1:], one.tsdf)
    assert not torch.equal(later.condition, one.condition)
    other = tiny.data(stacks, resolution, seed=1)
    assert not torch.equal(
        other.training_batch(IndexBatch(3, torch.tensor([1])), CPU).condition, one.condition
    )


def test_validation_has_its_own_views_and_truths_in_metres(stacks):
    data = tiny.data(stacks)
    chosen = IndexBatch(0, torch.tensor([0]))
    made = data.validation_batch(chosen, CPU)
    assert torch.equal(data.validation_batch(chosen, CPU).condition, made.condition)
    torch.testing.assert_close(made.truths["tsdf"], made.tsdf * data.grid.truncation)
    assert data.training_batch(chosen, CPU).truths == {}


def test_no_representation_is_one_line(stacks):
    with pytest.raises(ConfigError, match="no volume to train on"):
        tiny.data(stacks, representations={})


@pytest.mark.parametrize("resolution", [8, 16])
def test_training_scenes_are_seen_as_often_as_counts_say(stacks, resolution):
    chosen, first = IndexBatch(3, torch.arange(6)), IndexBatch(0, torch.tensor([0]))
    once, several = (tiny.data(stacks, resolution, counts=counts) for counts in ([1], [1, 2, 4]))
    seen = [
        data.training_batch(chosen, CPU).condition[:, 1].sum(dim=(1, 2, 3))
        for data in (once, several)
    ]
    assert bool((seen[1] >= seen[0]).all())
    assert 0 < int((seen[1] > seen[0]).sum()) < 6
    checked = [data.validation_batch(first, CPU).condition for data in (once, several)]
    assert torch.equal(*checked)
    assert "views_of_a_scene" not in once.facts()
    assert several.facts()["views_of_a_scene"] == [1, 2, 4]


@pytest.mark.parametrize("counts", [[], [0], [1, -2]])
def test_counts_of_views_are_positive(stacks, counts):
    with pytest.raises(ConfigError, match=r"dataset\.counts.*1 or more"):
        tiny.data(stacks, counts=counts)
