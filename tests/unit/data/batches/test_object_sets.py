import numpy as np
import torch
from tests.unit.data.stacks_file import write_stacks
from tests.unit.learning.tiny import views

from scenefw.core.types import GridSpec
from scenefw.data.batches.object_sets import ObjectSetViews, object_set_batch
from scenefw.data.batches.stack_volumes import StackData
from scenefw.data.batches.stacks import StackScenes
from scenefw.representations.volumes import object_occupancy


def test_objects_are_those_of_the_scenes(tmp_path):
    """Each centre and each voxel, beside the occupancy of single objects, which may overlap."""
    write_stacks(tmp_path / "stacks.npz")
    data = ObjectSetViews(views(16), str(tmp_path / "stacks.npz"), validation_limit=2)
    data.views.augmentation = None
    batch = data.validation_batch(data.val_dataloader().batch(0), torch.device("cpu"))
    scenes = StackScenes(tmp_path / "stacks.npz", "val").parameters([0, 1])
    occupancy = object_occupancy(scenes, data.grid)
    labels = torch.arange(1, scenes.present.shape[1] + 1)[None, :, None, None, None]
    mine = batch.instances[:, None] == labels
    assert not (mine & ~occupancy).any()
    assert torch.equal(mine.any(dim=1), occupancy.any(dim=1))
    assert torch.equal(batch.present, mine.flatten(2).any(dim=2))
    assert torch.equal(batch.occupancy[:, 0], occupancy.any(dim=1).float())
    grid = data.grid
    for scene, i in batch.present.nonzero().tolist():
        world = np.array(grid.lower) + (batch.centres[scene, i].numpy() + 1) / 2 * grid.extent
        np.testing.assert_allclose(world, scenes.positions[scene, i], atol=1e-6)
    assert data.most == int(
        StackScenes(tmp_path / "stacks.npz", "all").parameters(list(range(17))).present.sum(1).max()
    )


def test_views_are_those_of_any_training_on_stacks(tmp_path):
    """The same seed, epoch and scene give the same motion and the same view."""
    write_stacks(tmp_path / "stacks.npz")
    options = {"path": str(tmp_path / "stacks.npz"), "limit": 6, "batch_size": 2, "seed": 3}
    sets, stacks = ObjectSetViews(views(16), **options), StackData(views(16), **options)
    number = sets.train_dataloader().batch(4)
    mine = sets.training_batch(number, torch.device("cpu"))
    theirs = stacks.training_batch(number, torch.device("cpu"))
    assert torch.equal(mine.condition, theirs.condition)
    assert torch.equal(mine.occupancy, (theirs.tsdf < 0).float())


def test_an_object_without_a_voxel_is_absent(tmp_path):
    write_stacks(tmp_path / "stacks.npz")
    scenes = StackScenes(tmp_path / "stacks.npz", "train", 1).parameters([0])
    scenes.half_axes[0, 0] = 1e-4
    maker = views(8)
    made = maker.make_one(scenes, np.random.default_rng(0))
    batch = object_set_batch(made, GridSpec(8))
    assert not batch.present[0, 0]
