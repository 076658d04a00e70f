"""The task from two steps to a card; references are counted by hand or given by numpy."""

import json

import numpy as np
import pytest
import torch

from scenefw import config, plugins
from scenefw.core.batches import PartialTSDF
from scenefw.core.errors import ConfigError
from scenefw.core.types import GridSpec
from scenefw.data.batches.stacks import StackScenes
from scenefw.execution.build import Builder
from scenefw.learning.checkpoint import load_checkpoint
from scenefw.losses.tsdf import TsdfLoss
from scenefw.perception.estimate.assembly import SceneAssembly
from scenefw.perception.pipeline import ReconstructionPipeline
from scenefw_object_count.batches import CountBatch
from scenefw_object_count.counters import BaseRate, NetworkCounter
from scenefw_object_count.evaluation import CountedView, CountResult
from scenefw_object_count.learning import CountLearning
from scenefw_object_count.log_score import LogScore
from scenefw_object_count.network import CountNetwork
from scenefw_object_count.reconstruction import CountedParts

SMOKE = ("experiment=object_count", "debug=smoke", "device=cpu")


def test_two_steps_a_score_and_a_card(scenefw, tmp_path):
    words = (*SMOKE, "size.test_scenes=2", "run.train.log_every=1")
    process = scenefw(*words, "paths.output=out")
    assert process.returncode == 0, process.stderr[-3000:]
    figures = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert figures["train/steps"] == 2
    assert figures["views"] == 2
    gain = figures["base_rate/log_score"] - figures["log_score"]
    assert figures["gain"] == pytest.approx(gain)
    assert "p(8)" in (tmp_path / "out" / "report.html").read_text()
    weights = ("checkpoint=out/object_count.safetensors", "run.results=[out]")
    process = scenefw("experiment=object_count", "run=card", *weights, "paths.output=card")
    assert process.returncode == 0, process.stderr[-3000:]
    assert "| log score (nats) ↓ |" in (tmp_path / "card" / "object_count.md").read_text()


def test_weights_that_ship_are_found_by_name_and_beat_random_ones():
    """On 12 views of the test split, by the log score, beside the base rate too."""
    plugins.activate()
    words = ("experiment=object_count", "run=evaluate", "device=cpu", "size.test_scenes=12")
    evaluation = Builder(config.compose(words)).build("evaluation")
    shipped = evaluation.methods["network"]
    assert shipped.model.recipe["_target_"] == "scenefw_object_count.network.CountNetwork"
    torch.manual_seed(0)
    random = load_checkpoint("object_count", task="object_count")
    random.model.head = CountNetwork(**_arguments(random.recipe)).head
    evaluation.methods["random"] = NetworkCounter(random)
    figures = evaluation.run().figures
    assert figures["log_score"] < figures["base_rate/log_score"] - 0.2
    assert figures["log_score"] < figures["random/log_score"] - 0.2


def _arguments(recipe):
    return {name: value for name, value in recipe.items() if name != "_target_"}


def test_the_loss_is_the_logarithm_of_the_probability_of_the_truth():
    probabilities = np.array([[0.5, 0.3, 0.2], [0.1, 0.1, 0.8]])
    batch = CountBatch(torch.zeros(2, 2, 4, 4, 4), torch.tensor([2, 3]))
    loss = LogScore()(torch.from_numpy(np.log(probabilities)) + 7.0, batch)
    assert float(loss) == pytest.approx(-(np.log(0.3) + np.log(0.8)) / 2)


def test_figures_of_two_views_counted_by_hand():
    probabilities = {"network": np.array([0.2, 0.8]), "base_rate": np.array([0.5, 0.5])}
    views = (CountedView(0, 2, probabilities), CountedView(1, 1, probabilities))
    figures = CountResult(views, ("network", "base_rate")).figures
    assert figures["log_score"] == pytest.approx(-np.log(0.8 * 0.2) / 2)
    assert figures["base_rate/log_score"] == pytest.approx(np.log(2))
    assert (figures["accuracy"], figures["count_error"]) == (0.5, 0.5)
    # What was given nothing
    assert CountedView(0, 3, probabilities).scores("network")["log_score"] > 100


def test_the_base_rate_is_that_of_the_training_scenes():
    scenes = StackScenes("stacks_v1", "train")  # of 3 or 4 objects
    partial = PartialTSDF(torch.zeros(2, 1, 4, 4, 4), torch.ones(2, 1, 4, 4, 4, dtype=torch.bool))
    rates = BaseRate(scenes).probabilities(partial, GridSpec(4))
    share = float(
        (scenes.parameters([*range(len(scenes))]).present.sum(dim=1) == 3).double().mean()
    )
    assert rates.shape == (2, 8)
    assert rates.sum(dim=1).tolist() == pytest.approx([1, 1])
    assert float(rates[0, 2]) == pytest.approx(share, abs=1e-3)
    assert 0 < float(rates[0, 6]) < 1e-3


class Sure:
    """Counts two, whatever it sees."""

    def __init__(self, grid):
        self.grid, self.metadata = grid, {}

    def probabilities(self, partial, grid):
        return torch.tensor([[0.0, 1.0, 0.0]]).expand(len(partial.distance), -1)


@pytest.mark.parametrize("resolution", [16, 32])
def test_two_boxes_are_cut_apart(resolution):
    grid, size = GridSpec(resolution), resolution // 4
    boxes = [(slice(a * size // 2, a * size // 2 + size),) * 2 for a in (1, 5)]
    distance = torch.full((1, 1, *grid.shape), grid.truncation)
    for box in boxes:
        distance[(..., *box, slice(size, 2 * size))] = -0.01
    partial = PartialTSDF(distance, torch.ones_like(distance, dtype=torch.bool))
    pipeline = ReconstructionPipeline(SceneAssembly(), completion=CountedParts(Sure(grid)))
    samples = pipeline.complete(partial, grid, 2, torch.Generator().manual_seed(0))
    assert len(samples) == 2
    for scene in samples:
        first, second = (scene.instances[0][(*box, slice(size, 2 * size))] for box in boxes)
        assert len(first.unique()) == len(second.unique()) == 1
        assert {int(first[0, 0, 0]), int(second[0, 0, 0])} == {1, 2}
        assert int((scene.instances > 0).sum()) == 2 * size**3


def test_data_with_more_objects_than_the_network_knows_are_refused():
    class Data:
        most = 8

    learning = CountLearning(CountNetwork(most=4), {"log_score": LogScore()}, 1e-3)
    with pytest.raises(ConfigError, match=r"model\.most=8"):
        learning.check(Data())


def test_losses_of_other_trainings_are_refused():
    class Data:
        most = 8

    learning = CountLearning(CountNetwork(), {"log_score": LogScore(), "tsdf": TsdfLoss()}, 1e-3)
    with pytest.raises(ConfigError, match=r"the loss tsdf is for .* ShapeInstanceSetup"):
        learning.check(Data())
