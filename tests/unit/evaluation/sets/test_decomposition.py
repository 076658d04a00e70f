import dataclasses

import numpy as np
import pytest
import torch
from tests.unit.data.stacks_file import write_stacks
from tests.unit.learning.tiny import Circle

from scenefw.core.batches import Completion
from scenefw.core.errors import ConfigError
from scenefw.core.object_sets import ObjectSetPrediction
from scenefw.core.types import GridSpec
from scenefw.data.batches.stacks import StackScenes
from scenefw.evaluation.sets.decomposition import DecompositionEvaluation
from scenefw.evaluation.sets.methods import (
    Components,
    FoundSet,
    NetworkDecomposer,
    Nothing,
    ReconstructedSet,
    of_instances,
)
from scenefw.evaluation.sets.published import ROWS
from scenefw.evaluation.sets.results import DecomposedScene, DecompositionResult, SceneCodes
from scenefw.mapping.projective import Projective
from scenefw.models.set_autoencoder import SetAutoencoder
from scenefw.models.set_vae import SetVAE
from scenefw.postprocessing.connected_components import ConnectedComponents
from scenefw.renderers.sphere_tracer import SphereTracer

GRID = GridSpec(16)
SMALL = {"encoder_widths": (4, 4), "decoder_widths": (4, 4), "code_size": 4}


class Truth:
    """Decomposes perfectly, as sure as told."""

    grid = GRID
    logit = 20.0

    def decompose(self, scene):
        instances = scene.batch.instances
        found = of_instances(instances[0])
        ids = np.unique(instances[instances > 0])
        inside = instances == torch.from_numpy(ids)[:, None, None, None]
        logits = torch.where(inside, self.logit, -self.logit)[None]
        count = len(ids)
        codes = torch.arange(count).float()[None, :, None].expand(1, count, 4)
        cells = torch.arange(count)[None]
        features = torch.zeros(1, 4, 2, 2, 2)
        features.view(1, 4, 8)[..., :count] = 1.0
        prediction = ObjectSetPrediction(logits, codes, cells, features)
        return dataclasses.replace(found, prediction=prediction, exists=np.ones(count, bool))


class Checkpoint:
    grid, metadata = GRID, {}

    def __init__(self, model):
        self.model = model


def evaluation(folder, methods, **options):
    write_stacks(folder / "stacks.npz", objects=2)
    scenes = StackScenes(folder / "stacks.npz", "test")
    return DecompositionEvaluation(
        scenes, methods, Circle(), SphereTracer(), Projective(), **options
    )


def test_the_truth_is_perfect_and_nothing_is_the_worst(tmp_path):
    torch.manual_seed(0)
    methods = {
        "truth": Truth(),
        "nothing": Nothing(0.01),
        "components": Components(ConnectedComponents(0.0)),
        "network": NetworkDecomposer(Checkpoint(SetAutoencoder(16, 3, **SMALL))),
        "absent": None,
    }
    result = evaluation(tmp_path, methods, published="of_six", examples=1).run()
    figures = result.figures
    perfect = {"object_iou": 1.0, "ari": 1.0, "occupancy_iou": 1.0, "missing_or_joined": 0.0,
               "duplicate_or_split": 0.0, "count_error": 0.0}  # fmt: skip
    for name, value in perfect.items():
        assert figures[name] == pytest.approx(value), name
    assert figures["cross_entropy"] == pytest.approx(0.0, abs=1e-6)
    worst = {"object_iou": 0.0, "missing_or_joined": 1.0, "duplicate_or_split": 0.0, "ari": 0.0}
    counts = [one.objects for one in result.scenes]
    for name, value in worst.items():
        several = [one.scores["nothing"][name] for one in result.scenes if one.objects > 1]
        assert np.mean(several) == pytest.approx(value), name
    assert figures["nothing/count_excess"] == -np.mean(counts)
    assert "components/cross_entropy" not in figures  # it gives no probabilities
    assert figures["components/occupancy_iou"] == 1.0
    assert figures["network/object_iou"] < 0.5
    assert len(result.examples) == 1
    assert set(result.examples[0].labels) == {"truth", *result.methods}
    assert result.measures["cross_entropy"].published == ROWS["of_six"].cross_entropy
    assert result.measures["object_iou"].trivial == "nothing/object_iou"
    assert figures["mean_gap"] == pytest.approx(1.0)


def test_the_cross_entropy_of_a_constant_is_that_of_its_share(tmp_path):
    """One voxel value everywhere: by hand from how many voxels objects have."""
    found = evaluation(tmp_path, {"truth": Truth(), "nothing": Nothing(0.01, slots=2)})
    scene, example = found.look(0)
    share = (example.labels["truth"] > 0).sum() / (2 * GRID.resolution**3)
    expected = -share * np.log(0.01) - (1 - share) * np.log(0.99)
    assert scene.scores["nothing"]["cross_entropy"] == pytest.approx(expected, rel=1e-4)


class AllButFirst(Truth):
    """The truth without its first object."""

    def decompose(self, scene):
        found = super().decompose(scene)
        return FoundSet(found.objects[1:], np.maximum(found.labels - 1, 0))


def test_an_object_that_nobody_sees_is_missed_by_nobody(tmp_path):
    methods = {"truth": Truth(), "all_but_first": AllButFirst()}
    shown = evaluation(tmp_path, methods, enough=1).run()
    assert shown.figures["hardly_seen"] == 0.0
    assert shown.figures["missing_seen"] == 0.0
    assert shown.figures["all_but_first/missing_seen"] == 1.0
    hidden = evaluation(tmp_path, methods, enough=10**7).run()
    assert hidden.figures["hardly_seen"] == 1.0
    assert hidden.figures["all_but_first/missing_seen"] == 0.0
    assert hidden.figures["all_but_first/missing"] == 1.0
    assert [one.hidden for one in hidden.scenes] == [one.objects for one in hidden.scenes]


class Recorder:
    grid = GRID

    def complete(self, partial, grid, samples, generator):
        instances = torch.zeros(1, *grid.shape, dtype=torch.int32)
        instances[0, :2], instances[0, 4:6] = 7, 3
        return [Completion(torch.zeros(1, *grid.shape), instances)] * samples


def test_instances_of_a_reconstructor_become_a_set():
    class Seen:
        partial, grid, draws = None, GRID, None

    found = ReconstructedSet(Recorder()).decompose(Seen())
    assert found.objects.sum(axis=(1, 2, 3)).tolist() == [512, 512]
    assert found.objects[0, 4, 0, 0]
    assert found.labels[4, 0, 0] == 1
    assert found.labels[0, 0, 0] == 2


def test_what_does_not_exist_is_no_object(tmp_path):
    """By its volume, and by its score."""
    torch.manual_seed(0)
    model = SetAutoencoder(16, 3, existence=True, **SMALL)
    torch.nn.init.constant_(model.head.decoder.head.bias, 50.0)  # everything is occupied
    torch.nn.init.constant_(model.head.existence.weight, 0.0)
    counts = {}
    for score, smallest in ((5.0, 0.5), (5.0, 1.5), (-5.0, 0.5)):
        torch.nn.init.constant_(model.head.existence.bias, score)
        method = NetworkDecomposer(Checkpoint(model), smallest=smallest)
        figures = evaluation(tmp_path, {"network": method}).run().figures
        counts[score, smallest] = figures["count_excess"] + figures["objects"]
    assert counts == {(5.0, 0.5): 3.0, (5.0, 1.5): 0.0, (-5.0, 0.5): 0.0}


def test_draws_need_a_prior_and_are_the_same_again(tmp_path):
    with pytest.raises(ConfigError, match="no prior to draw from"):
        NetworkDecomposer(Checkpoint(SetAutoencoder(16, 3, **SMALL)), drawn=True)
    torch.manual_seed(0)
    model = SetVAE(16, 3, **SMALL, condition_widths=(4,) * 5, bottleneck=4)
    method = NetworkDecomposer(Checkpoint(model), drawn=True)
    scores = [evaluation(tmp_path, {"drawn": method}).run().figures for _ in range(2)]
    assert scores[0] == scores[1]
    other = NetworkDecomposer(Checkpoint(model), drawn=True, draw=1)
    assert evaluation(tmp_path, {"drawn": other}).run().figures != scores[0]
    with pytest.raises(ConfigError, match="draw = -1"):
        NetworkDecomposer(Checkpoint(model), drawn=True, draw=-1)


def test_mistakes_are_one_line(tmp_path):
    with pytest.raises(ConfigError, match=r"no method .* has a grid"):
        evaluation(tmp_path, {"nothing": Nothing()})
    with pytest.raises(ConfigError, match="published is table; expected of_six"):
        evaluation(tmp_path, {"truth": Truth()}, published="table")
    with pytest.raises(ConfigError, match="suppress = 0"):
        NetworkDecomposer(Checkpoint(SetAutoencoder(16, 3, **SMALL)), suppress=0)
    with pytest.raises(ConfigError, match="share = 0"):
        Nothing(0)


def test_means_over_scenes_with_bounds_and_gaps_of_codes():
    features = np.zeros((2, 8), np.float32)
    features[:, 3], features[:, 5] = 2.0, 1.0
    scenes = []
    for number, error in enumerate((0.0, 1.0, 1.0)):
        codes = SceneCodes(features, np.array([3, number]), np.array([True, False]), features.T[:2])
        scores = {"ours": {"missing_or_joined": error}, "theirs": {"missing_or_joined": 1.0}}
        scenes.append(DecomposedScene(number, 4, scores, codes))
    result = DecompositionResult(tuple(scenes), ("ours", "theirs"))
    figures = result.figures
    assert figures["missing_or_joined"] == pytest.approx(2 / 3)
    assert figures["missing_or_joined_low"] < 2 / 3 < figures["missing_or_joined_high"]
    assert figures["theirs/missing_or_joined"] == 1.0
    assert figures["mean_gap"] == pytest.approx(1.0 - 1 / 6)
    assert figures["cells_used"] == 1
    assert set(figures) - set(result.measures) == {
        f"missing_or_joined{end}" for end in ("_low", "_high")
    }


def test_an_empty_set_has_labels_of_nothing():
    found = of_instances(torch.zeros(4, 4, 4, dtype=torch.int32))
    assert isinstance(found, FoundSet)
    assert found.objects.shape == (0, 4, 4, 4)
    assert not found.labels.any()
