"""Strategies side by side: each gives what it gives alone, and shared work is done once."""

import numpy as np
import pytest
import torch
from tests.unit.labelling.fakes import Heights, Labels, Maps, Scenes, Views, frames

from scenefw.core.errors import ConfigError, InputError
from scenefw.evaluation.labelling.bench import Bench
from scenefw.evaluation.labelling.shared_parts import (
    FUSION,
    LOADING,
    MAP_NETWORK,
    RECONSTRUCTION,
    VIEW_NETWORK,
    alike,
)
from scenefw.evaluation.labelling.stopwatch import OTHER, SharedWork
from scenefw.labelling.hybrid import Hybrid
from scenefw.labelling.key_frames import EveryNth
from scenefw.labelling.map_based import MapBased
from scenefw.labelling.view_based import ViewBased
from scenefw.noise.gaussian import Gaussian


def strategies(**views):
    return {
        "view_based": ViewBased(Heights(), Labels(), Views(), **views),
        "map_based": MapBased(Heights(), Maps()),
        "hybrid": Hybrid(Heights(), Labels(), Views(), Maps(), **views),
    }


def test_side_by_side_is_as_alone():
    together = Bench(Scenes(), strategies(key_frames=EveryNth(2), refresh=1))
    for name, strategy in strategies(key_frames=EveryNth(2), refresh=1).items():
        running = strategy.begin()
        snapshots = together.run(0, [2, 5])
        for i, frame in enumerate(frames(5)):
            running.add(frame)
            if i + 1 in (2, 5):
                ours, alone = next(snapshots)[name].height_map, running.height_map()
                np.testing.assert_array_equal(ours.labels, alone.labels)
                np.testing.assert_array_equal(ours.probabilities, alone.probabilities)
                np.testing.assert_array_equal(ours.heights, alone.heights)


def test_shared_work_is_done_once():
    chosen = strategies()
    list(Bench(Scenes(), chosen).run(0, [2, 4]))
    assert chosen["view_based"].source.calls == 4
    assert chosen["map_based"].map_source.calls == 2
    assert chosen["hybrid"].views.source.calls == chosen["hybrid"].map_source.calls == 0


def test_every_strategy_pays_for_its_stages():
    (snapshots,) = Bench(Scenes(), strategies()).run(0, [3])
    spent = {name: snapshot.seconds for name, snapshot in snapshots.items()}
    assert set(spent["view_based"]) == {LOADING, RECONSTRUCTION, VIEW_NETWORK, FUSION, OTHER}
    assert set(spent["map_based"]) == {LOADING, RECONSTRUCTION, MAP_NETWORK, OTHER}
    assert set(spent["hybrid"]) == set(spent["view_based"]) | {MAP_NETWORK}
    for stage in {*spent["view_based"]} - {OTHER}:
        assert spent["view_based"][stage] == spent["hybrid"][stage]
    hybrid = snapshots["hybrid"]
    assert hybrid.processing == pytest.approx(
        sum(hybrid.seconds.values()) - hybrid.seconds[LOADING]
    )


def test_the_map_is_paid_once_however_often_it_was_asked_for(monkeypatch):
    """The map's labels after 2 frames don't count for the map after 4."""
    clock = iter(range(1000))
    monkeypatch.setattr(
        "scenefw.evaluation.labelling.stopwatch.time.perf_counter", lambda: next(clock)
    )
    first, second = Bench(Scenes(), strategies()).run(0, [2, 4])
    for snapshots in (first, second):
        assert snapshots["map_based"].seconds[MAP_NETWORK] == 1
    assert first["map_based"].seconds[RECONSTRUCTION] == 2 + 1
    assert second["map_based"].seconds[RECONSTRUCTION] == 4 + 1


def test_work_of_a_turn():
    work, done = SharedWork(), []
    for turn in (0, 0, 1):
        work.turn = turn
        for method in ("a", "b"):
            with work.of(method):
                work.do("stage", "what", lambda: done.append(1))
    assert len(done) == 2
    assert work.spent("a")["stage"] == work.spent("b")["stage"]
    assert work.calls("a") == {"stage": 3}
    assert work.spent("c") == {}


def test_what_a_method_does_alone_is_its_own(monkeypatch):
    clock = iter([0.0, 1.0, 4.0, 10.0, 20.0, 22.0])
    monkeypatch.setattr(
        "scenefw.evaluation.labelling.stopwatch.time.perf_counter", lambda: next(clock)
    )
    work = SharedWork()
    with work.of("a"):
        work.do("stage", "what", lambda: None)
    with work.of("b"):
        work.do("stage", "what", lambda: None)
    assert work.spent("a") == {"stage": 3.0, OTHER: 7.0}
    assert work.spent("b") == {"stage": 3.0, OTHER: 2.0}


def test_parts_of_other_settings_cannot_be_compared():
    different = Labels()
    different.floor = 0.1
    chosen = strategies()
    chosen["hybrid"] = Hybrid(Heights(), different, Views(), Maps())
    with pytest.raises(ConfigError, match=r"view_based and hybrid share .* label fusion"):
        Bench(Scenes(), chosen)
    Bench(Scenes(), {"hybrid": chosen["hybrid"]})


def test_networks_are_alike_if_their_weights_are():
    def made(seed, **settings):
        torch.manual_seed(seed)
        source = Views()
        source.model, source.settings = torch.nn.Linear(2, 3), settings
        return source

    assert alike(made(0, size=[1, 2.0]), made(0, size=[1, 2.0]))
    assert not alike(made(0), made(1))
    assert not alike(made(0, size=[1, 2.0]), made(0, size=[1, 3.0]))
    assert not alike(made(0, size=1), made(0))
    assert not alike(made(0, at=np.zeros(2)), made(0, at=np.ones(2)))
    assert not alike(Views(), Maps())


def test_key_frames_must_be_shared_to_be_compared():
    chosen = strategies()
    chosen["hybrid"] = Hybrid(Heights(), Labels(), Views(), Maps(), key_frames=EveryNth(2))
    with pytest.raises(ConfigError, match="key frames"):
        list(Bench(Scenes(), chosen).run(0, [2]))


def test_noise_reaches_the_frames():
    bench = Bench(Scenes(), strategies(), {"gaussian": Gaussian(0.01)})
    (noisy,) = bench.run(0, [1])
    (clean,) = bench.run(0, [1], {})
    assert not np.array_equal(
        noisy["map_based"].height_map.heights, clean["map_based"].height_map.heights
    )


def test_wrong_use():
    with pytest.raises(ConfigError, match="no strategy"):
        Bench(Scenes(), {})
    other = Scenes()
    other.classes = ("surface", "coin", "pen")
    with pytest.raises(ConfigError, match="surface, coin, pen"):
        Bench(other, strategies())
    short = Scenes()
    short.frames = lambda scene, count: iter([])
    with pytest.raises(InputError, match="fewer frames"):
        list(Bench(short, strategies()).run(0, [1]))
