"""Strategies side by side: each gives what it gives alone, and shared work is done once."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from tests.unit.labelling.fakes import Heights, Labels, Maps, Scenes, Views, frames

from scenefw.core.errors import ConfigError, InputError
from scenefw.labelling.hybrid import Hybrid
from scenefw.labelling.key_frames import EveryNth
from scenefw.labelling.map_based import MapBased
from scenefw.labelling.view_based import ViewBased
from scenefw.noise.gaussian import Gaussian
from scenefw_labelling_studies.bench import Bench
from scenefw_labelling_studies.shared_parts import (
    FUSION,
    LOADING,
    MAP_NETWORK,
    RECONSTRUCTION,
    VIEW_NETWORK,
)
from scenefw_labelling_studies.stopwatch import OTHER, SharedWork


def strategies(**views):
    heights, labels, source, map_source = Heights(), Labels(), Views(), Maps()
    return {
        "view_based": ViewBased(heights, labels, source, **views),
        "map_based": MapBased(heights, map_source),
        "hybrid": Hybrid(heights, labels, source, map_source, **views),
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
        "scenefw_labelling_studies.stopwatch.time.perf_counter", lambda: next(clock)
    )
    first, second = Bench(Scenes(), strategies()).run(0, [2, 4])
    for snapshots in (first, second):
        assert snapshots["map_based"].seconds[MAP_NETWORK] == 1
    assert first["map_based"].seconds[RECONSTRUCTION] == 2 + 1
    assert second["map_based"].seconds[RECONSTRUCTION] == 4 + 1


def test_work_of_a_turn():
    work, done = SharedWork(), []
    for turn in (0, 0, 1):
        work.begin_turn(turn)
        for method in ("a", "b"):
            with work.of(method):
                work.do("stage", "what", lambda: done.append(1))
    assert len(done) == 2
    assert work.spent("a")["stage"] == work.spent("b")["stage"]
    assert work.calls("a") == {"stage": 3}
    first, second = [work.do("stage", "of", list, (each,)) for each in ("x", "y")]
    assert first is not second
    assert work.do("stage", "of", list, ("x",)) is first
    assert work.spent("c") == {}


def test_what_a_method_does_alone_is_its_own(monkeypatch):
    clock = iter([0.0, 1.0, 4.0, 10.0, 20.0, 22.0])
    monkeypatch.setattr(
        "scenefw_labelling_studies.stopwatch.time.perf_counter", lambda: next(clock)
    )
    work = SharedWork()
    with work.of("a"):
        work.do("stage", "what", lambda: None)
    with work.of("b"):
        work.do("stage", "what", lambda: None)
    assert work.spent("a") == {"stage": 3.0, OTHER: 7.0}
    assert work.spent("b") == {"stage": 3.0, OTHER: 2.0}


def alone(strategy, count):
    running = strategy.begin()
    for frame in frames(count):
        running.add(frame)
    return running.height_map()


def test_strategies_share_only_what_both_hold():
    """Another source needs another fusion; heights are shared all the same."""

    class Others(Views):
        def label(self, frame):
            return super().label(frame)[::-1].copy()

    heights, source, other = Heights(), Views(), Others()
    chosen = {
        "one": ViewBased(heights, Labels(), source),
        "other": ViewBased(heights, Labels(), other),
    }
    (snapshots,) = Bench(Scenes(), chosen).run(0, [3])
    assert source.calls == other.calls == 3
    for name, snapshot in snapshots.items():
        np.testing.assert_array_equal(snapshot.height_map.labels, alone(chosen[name], 3).labels)


class Skipping:
    """Leaves out every other frame; no dataclass, so that it shares nothing."""

    classes = Views.classes

    def __init__(self, strategy):
        self.strategy = strategy

    def begin(self, previous=None, states=None):
        running = self.strategy.begin(previous, states)
        taken, add = iter([True, False] * 9), running.add
        running.add = lambda frame: add(frame) if next(taken) else None
        return running


def test_a_strategy_that_is_no_dataclass_runs_on_its_own():
    heights, source = Heights(), Maps()
    chosen = {
        "map_based": MapBased(heights, source),
        "skipping": Skipping(MapBased(heights, source)),
    }
    (snapshots,) = Bench(Scenes(), chosen).run(0, [3])
    assert source.calls == 2
    assert set(snapshots["skipping"].seconds) == {LOADING, OTHER}
    whole, half = (snapshots[name].height_map.seen[0] for name in ("map_based", "skipping"))
    assert whole[:24].all()
    assert half[:24].tolist() == [True] * 8 + [False] * 8 + [True] * 8


@dataclass(frozen=True)
class Twice:
    """Fuses each frame into two maps, or the first frame alone."""

    heights: Heights
    frames: int = 99

    classes = Views.classes

    def begin(self, previous=None, states=None):
        maps, limit = [self.heights.begin(), self.heights.begin()], self.frames

        class Running:
            def __init__(self):
                self.count = 0

            def add(self, frame):
                self.count += 1
                maps[0].add(frame)
                if self.count <= limit:
                    maps[1].add(frame)

            def height_map(self):
                return [each.height_map() for each in maps][1]

        return Running()


def test_every_map_that_a_strategy_begins_is_its_own():
    """The first two share both maps, the third feeds its second one with other frames."""
    heights = Heights()
    chosen = {"a": Twice(heights), "b": Twice(heights)}
    (snapshots,) = Bench(Scenes(), chosen).run(0, [3])
    assert snapshots["a"].height_map is snapshots["b"].height_map
    assert snapshots["a"].height_map.confidence[0, 0] == 1
    with pytest.raises(ConfigError, match="share their reconstruction"):
        list(Bench(Scenes(), {"a": Twice(heights), "c": Twice(heights, 1)}).run(0, [3]))


def test_key_frames_must_be_shared_to_be_compared():
    chosen = strategies()
    chosen["hybrid"] = replace(chosen["hybrid"], key_frames=EveryNth(2))
    with pytest.raises(ConfigError, match="key_frames"):
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
