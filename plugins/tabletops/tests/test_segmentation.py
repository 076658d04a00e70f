import numpy as np
import pytest
import torch
from tests.unit.data.rectangles import Rectangles

from scenefw.core.batches import IndexBatch
from scenefw.core.errors import ConfigError
from scenefw.data.epochs import EpochBatches
from scenefw.noise.gaussian import Gaussian
from scenefw.noise.pose import Jitter
from scenefw_tabletops.data.fused_maps import FusedMaps
from scenefw_tabletops.data.label_views import StoredViews, ViewSamples
from scenefw_tabletops.data.map_crops import MapCrops, StoredMaps
from scenefw_tabletops.data.segmentation import SegmentationData

CPU = torch.device("cpu")


def views(source=None):
    return ViewSamples(StoredViews(source or Rectangles(), 3))


def test_batches_are_the_samples():
    train, crops = views(), MapCrops(StoredMaps(Rectangles()), 3, (48, 40))
    data = SegmentationData(train, crops, batch_size=2)
    data.setup("fit")
    assert data.classes == ("surface", "red", "blue")
    assert len(data.train_dataloader()) == 3
    batch = data.training_batch(IndexBatch(1, torch.tensor([2, 5])), CPU)
    assert batch.colour.shape == (2, 3, 40, 48)
    assert batch.distance.shape == (2, 1, 40, 48)
    assert batch.labels.dtype == torch.int64
    alone = train.batch(np.array([5]), 1, CPU)
    assert torch.equal(batch.labels[1], alone.labels[0])
    held_out = data.validation_batch(IndexBatch(7, torch.tensor([0])), CPU)
    assert torch.equal(held_out.labels, crops.batch(np.array([0]), None, CPU).labels)
    assert data.facts()["input"] == "views"


def test_two_processes_make_the_samples_that_one_makes():
    data = SegmentationData(views(), views(), batch_size=2)
    parts = [EpochBatches(6, 2, 0, rank, 2).batch(3) for rank in (0, 1)]
    together = torch.cat([part.indices for part in parts])
    assert len(together.unique()) == 4
    whole = data.training_batch(IndexBatch(parts[0].epoch, together), CPU)
    for row, part in enumerate(parts):
        mine = data.training_batch(part, CPU)
        assert torch.equal(mine.labels, whole.labels[2 * row : 2 * row + 2])
        assert torch.equal(mine.colour, whole.colour[2 * row : 2 * row + 2])


def test_two_splits_have_the_same_classes():
    other = Rectangles()
    other.classes = ("surface", "red", "green")
    with pytest.raises(ConfigError, match="green"):
        SegmentationData(views(), views(other))


def test_facts_say_what_is_seen_and_how_it_is_disturbed():
    noise = {"tracking": Jitter(0.003), "depth": Gaussian(0.01)}
    stored = StoredViews(Rectangles(), 3)
    heights = ViewSamples(stored, noise, geometry="height")
    fused = FusedMaps(Rectangles(), None, 7, None, {"exact": {}, "rough": noise})
    maps = MapCrops(StoredMaps(Rectangles(), fused), 3, (24, 16), unseen=0.25)
    found = SegmentationData(heights, maps, batch_size=2).facts()
    words = ["depth sigma=0.01 lowest=0.01 share=1", "tracking sigma=0.003 rotation=0.01 "]
    words[1] += "lowest=0.003 share=1"
    assert (found["scenes"], found["images"], found["noise"]) == (2, 6, words)
    assert (
        ViewSamples(stored, noise, geometry="depth").facts()["noise"] == words[:1]
    )  # depth needs no pose
    assert maps.facts() == {
        "scenes": 2,
        "height_noise": 0.0,
        "unseen": 0.25,
        "frames": [7],
        "spacing": Rectangles().truth(0).grid.spacing,
        "noise": ["exact", f"rough: {words[0]}: {words[1]}"],
    }
    assert "noise" not in MapCrops(StoredMaps(Rectangles()), 3, (24, 16)).facts()
