"""The evaluation of sets gives a method the true distances of the whole scene."""

import pytest
import torch
from tests.unit.evaluation.sets.test_decomposition import GRID, evaluation

from scenefw.core.batches import Completion
from scenefw.evaluation.sets.methods import Nothing
from scenefw.representations.volumes import scene_volumes
from scenefw_decomposing.decomposed_volume import DecomposedVolume


class WholeVolume:
    """Keeps the volume it was given, and says that all of it is one object."""

    def decompose(self, tsdf, grid, generator):
        self.tsdf, self.grid = tsdf, grid
        return Completion(tsdf[:, 0], (tsdf[:, 0] < 0).int())


def test_complete_volumes_are_taken_apart_without_a_network(tmp_path):
    """The grid is the evaluation's own, and the method is given the true distances."""
    method = WholeVolume()
    chosen = {"volume": DecomposedVolume(method), "nothing": Nothing(0.01)}
    made = evaluation(tmp_path, chosen, grid=GRID)
    figures = made.run().figures
    assert figures["occupancy_iou"] == 1.0
    assert figures["count_excess"] == pytest.approx(1 - figures["objects"])  # all of them as one
    assert figures["objects"] > 1
    assert figures["object_iou"] < 0.7
    last = made.scenes.parameters([len(made.scenes) - 1], "cpu")
    true = scene_volumes(last, GRID).tsdf
    torch.testing.assert_close(method.tsdf, true)
    assert method.grid == GRID
