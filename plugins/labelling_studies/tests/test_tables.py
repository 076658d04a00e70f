"""Tables 4.1 and 4.2, and the hybrid's weights, on fakes whose scores are known."""

from types import SimpleNamespace

import numpy as np
import pytest
from plugins.labelling_studies.tests.test_bench import strategies
from tests.unit.labelling.fakes import CLASSES, Heights, Maps, Scenes, Views

from scenefw.core.errors import ConfigError
from scenefw.labelling.reconstruction import Reconstruction
from scenefw.noise.gaussian import Gaussian
from scenefw_labelling_studies.bench import Bench
from scenefw_labelling_studies.networks import LabellingNetworks
from scenefw_labelling_studies.pool_weights import HybridWeights, balanced_accuracy
from scenefw_labelling_studies.times import LabellingTimes

NEAR = Reconstruction(confidence=0.1, deviation=0.01, window=3)


@pytest.fixture(scope="module")
def networks():
    return LabellingNetworks(Scenes(), Views(), Maps(), Heights(), views=4, frames=5).run()


def test_networks_are_scored_on_all_views_and_maps(networks):
    figures = networks.figures
    assert [figures[f"views/{name}"] for name in CLASSES] == pytest.approx([1, 10 / 11, 0])
    assert [figures[f"maps/{name}"] for name in CLASSES] == pytest.approx([1, 0.5, 1 / 6])
    assert figures["views/miou"] == pytest.approx(np.mean([1, 10 / 11, 0]))
    share = np.array([22, 10, 1]) / 33  # rows
    assert figures["views/weighted_iou"] == pytest.approx(share @ [1, 10 / 11, 0])
    assert (figures["views/number"], figures["maps/number"]) == (8, 2)
    assert networks.counts["views"].sum() == 8 * 33 * 8


def test_networks_of_other_classes_are_refused():
    views = Views()
    views.classes = ("surface", "coin")
    with pytest.raises(ConfigError, match="surface, coin"):
        LabellingNetworks(Scenes(), views, Maps(), Heights(), 1, 1)


def test_times_are_per_pass_and_per_frame(monkeypatch):
    clock = iter(range(10000))
    monkeypatch.setattr(
        "scenefw_labelling_studies.stopwatch.time.perf_counter", lambda: next(clock)
    )
    result = LabellingTimes(Bench(Scenes(), strategies()), frames=4, scenes=1).run()
    assert result.milliseconds["map_based"]["network, whole map"] == 1000
    assert result.milliseconds["view_based"]["network, one view"] == 1000
    assert result.milliseconds["view_based"]["reconstruction"] == 1000 * (4 + 1) / 4
    spent = {**result.milliseconds["map_based"]}
    assert result.per_frame["map_based"] == pytest.approx(
        spent["reconstruction"] + spent["network, whole map"] / 4 + spent["other"]
    )
    assert result.memory["process"] > 10
    assert all(np.isfinite(list(result.figures.values())))
    with pytest.raises(ConfigError, match="frames"):
        LabellingTimes(Bench(Scenes(), strategies()), frames=0)


def test_weights_make_the_pool_as_right_as_the_better_one():
    bench = Bench(Scenes(), strategies())
    result = HybridWeights(bench, NEAR, frames=5, steps=3, first=1, vertices=40).run()
    found = result.accuracy
    assert found["pool"] > max(found["views"], found["map"]) - 0.01  # likelihood is what is fitted
    assert result.figures["vertices"] == result.vertices > 0
    again = HybridWeights(bench, NEAR, frames=5, steps=3, first=1, vertices=40).run()
    assert again == result
    doubting = HybridWeights(bench, NEAR, frames=5, steps=3, first=1, vertices=40, doubt=0.3).run()
    assert doubting.pool.doubt == doubting.figures["doubt"] == 0.3
    assert doubting.pool != result.pool
    with pytest.raises(ConfigError, match="doubt = 1"):
        HybridWeights(bench, NEAR, frames=5, doubt=1.0)


def test_weights_are_estimated_on_scenes_under_noise_per_scene():
    seen = []

    class Watched(Bench):
        def run(self, scene, counts, noise=None):
            seen.append((scene, noise))
            return super().run(scene, counts, noise)

    options = {"frames": 2, "steps": 1, "vertices": 10}
    rough = {"gaussian": Gaussian(0.01)}
    bench = Watched(Scenes(), strategies())
    HybridWeights(bench, NEAR, **options, noise={"exact": {}, "rough": rough}).run()
    assert seen == [(0, {}), (1, rough)]
    HybridWeights(bench, NEAR, **options).run()
    assert seen[2:] == [(0, None), (1, None)]
    with pytest.raises(ConfigError, match="2 scenes can't use 3 noises"):
        HybridWeights(bench, NEAR, **options, noise={"a": {}, "b": rough, "c": {}})
    with pytest.raises(ConfigError, match="noise_per_scene=none"):
        HybridWeights(Bench(Scenes(), strategies(), rough), NEAR, **options, noise={"a": {}})


def test_weights_need_both_experts():
    with pytest.raises(ConfigError, match="map_based"):
        HybridWeights(Bench(Scenes(), {"view_based": strategies()["view_based"]}), NEAR, 5)


def test_vertices_are_drawn_from_what_the_iou_of_a_class_is_taken_over():
    truth = np.zeros((40, 40), np.int32)
    truth[10:20, 10:20] = 1
    truth[0, 0] = -1
    wider, exact = truth.clip(0), truth.clip(0)
    wider = wider.copy()
    wider[9:21, 9:21] = 1  # what views say bleeds over the outline
    maps = [
        SimpleNamespace(
            seen=np.ones(truth.shape, bool), probabilities=np.eye(2)[said].transpose(2, 0, 1)
        )
        for said in (wider, exact)
    ]
    maps[1].probabilities[:, 30:32, 30] = [[0.8], [0.2]]  # the pool may find these an object
    maps[1].probabilities[:, 32, 30] = 0.95, 0.05  # and hardly this one
    maps[1].probabilities[:, 33, 30] = 0.5  # of which the map knows nothing
    weights = HybridWeights(Bench(Scenes(), strategies()), NEAR, frames=5, vertices=1000)
    chosen, drawn_for = weights._draw(maps, truth, scene=0, frames=5)
    of_object = chosen[drawn_for == 1]
    concerned = wider == 1
    concerned[30:32, 30] = True
    assert sorted(of_object) == sorted(np.flatnonzero(concerned))
    assert (truth.ravel()[of_object] == 0).sum() == 12 * 12 - 10 * 10 + 2
    assert np.count_nonzero(drawn_for == 0) == 1000
    assert 0 not in chosen  # its label is unknown


def test_balanced_accuracy():
    of = np.array([0, 1, 1, 1, 1])
    truth = np.array([0, 0, 0, 0, 1])
    assert balanced_accuracy(np.array([0, 0, 0, 1, 1]), truth) == pytest.approx((0.75 + 1) / 2)
    assert balanced_accuracy(np.array([0, 0, 0, 1, 1]), truth, of) == pytest.approx((1 + 0.75) / 2)
