import numpy as np
import torch

from scenefw.core.object_sets import ObjectSetPrediction
from scenefw.core.types import GridSpec
from scenefw.perception.completion.suppression import chosen_objects, kept


def test_of_duplicates_the_surest_stays():
    inside = np.zeros((4, 4, 1, 1), bool)
    inside[0, :2], inside[1, :2], inside[2, 2:], inside[3, :] = True, True, True, True
    exists, scores = np.array([True, True, True, True]), np.array([1.0, 2.0, 0.5, 0.1])
    assert kept(inside, exists, scores, 0.9).tolist() == [False, True, True, True]
    assert kept(inside, exists, scores, 0.5).tolist() == [False, True, True, False]
    assert kept(inside, exists & (scores != 2), scores, 0.9).tolist() == [True, False, True, True]


def predicted(logits, existence=None):
    count = logits.shape[1]
    return ObjectSetPrediction(
        logits, torch.zeros(1, count, 0), torch.zeros(1, count).long(),
        torch.zeros(1, 0, 1, 1, 1), existence=existence,
    )  # fmt: skip


def test_a_voxel_is_the_most_probable_object_s():
    grid = GridSpec(8)
    logits = torch.full((1, 3, *grid.shape), -5.0)
    logits[0, 0, :4], logits[0, 1, 2:6], logits[0, 2, 7, 7, 7] = 1.0, 2.0, 3.0
    volume = grid.voxel_size**3
    found = chosen_objects(predicted(logits), 0, grid, 1.5 * volume, None)
    assert found.exists.tolist() == [True, True, False]  # the third has one voxel
    assert (found.labels[:2] == 1).all()
    assert (found.labels[2:6] == 2).all()
    assert not found.labels[6:].any()


def test_what_the_network_is_not_sure_of_is_no_object():
    grid = GridSpec(8)
    logits = torch.full((1, 2, *grid.shape), 1.0)
    found = chosen_objects(predicted(logits, torch.tensor([[-1.0, 1.0]])), 0, grid, 0.0, None)
    assert found.exists.tolist() == [False, True]
    assert (found.labels == 1).all()
    none = chosen_objects(predicted(logits, torch.tensor([[-1.0, -1.0]])), 0, grid, 0.0, None)
    assert not none.labels.any()
