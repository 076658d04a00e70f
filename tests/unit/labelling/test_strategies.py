"""View-based, map-based and hybrid labelling on a table whose fusion and networks are fakes."""

import numpy as np
import pytest
from tests.unit.labelling.fakes import CLASSES, GRID, Heights, Labels, Maps, Views, frames, truth

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.labels import FROM_BOTH, FROM_MAP, FROM_VIEWS, NO_SOURCE, UNKNOWN
from scenefw.labelling.hybrid import Hybrid
from scenefw.labelling.key_frames import ByMotion, EveryNth
from scenefw.labelling.map_based import MapBased
from scenefw.labelling.pooling import Pool, Weights
from scenefw.labelling.reconstruction import Reconstruction
from scenefw.labelling.view_based import ViewBased


def run(strategy, count, **begin):
    running = strategy.begin(**begin)
    for frame in frames(count):
        running.add(frame)
    return running


def view_based(**changes):
    return ViewBased(Heights(), Labels(), Views(), **changes)


def hybrid(**changes):
    near = Reconstruction(confidence=0.1, deviation=0.01, window=3)
    return Hybrid(Heights(), Labels(), Views(), Maps(), reconstruction=near, **changes)


def test_view_based_labels_what_was_seen():
    result = run(view_based(), 2).height_map()
    np.testing.assert_array_equal(
        result.labels[:, :16], np.where(truth().labels == 2, 1, truth().labels)[:, :16]
    )
    assert (result.labels[:, 16:] == UNKNOWN).all()
    assert (result.sources[:, :16] == FROM_VIEWS).all()
    assert (result.sources[:, 16:] == NO_SOURCE).all()
    assert result.classes == CLASSES


def test_view_based_labels_key_frames_only():
    strategy = view_based(key_frames=EveryNth(2))
    running = run(strategy, 4)
    assert strategy.source.calls == running.key_frames == 2
    result = running.height_map()
    assert np.isfinite(result.heights[:, :32]).all()
    assert (result.labels[:, 8:16] == UNKNOWN).all()  # seen, never labelled


@pytest.mark.parametrize(("refresh", "asked"), [(0, 0), (2, 2), (1, 4)])
def test_view_based_renews_the_map_that_fusion_reads(refresh, asked):
    assert run(view_based(refresh=refresh), 4).heights.asked == asked


def test_map_based_labels_when_asked():
    strategy = MapBased(Heights(), Maps())
    running = run(strategy, 2)
    assert strategy.map_source.calls == 0
    result = running.height_map()
    assert strategy.map_source.calls == 1
    assert (result.labels[10:15, :16] == 2).all()
    assert (result.labels[:, 16:] == UNKNOWN).all()
    assert (result.sources[:, :16] == FROM_MAP).all()


def test_map_based_labels_every_so_many_frames():
    strategy = MapBased(Heights(), Maps(), every=2)
    running = run(strategy, 3)
    result = running.height_map()
    assert strategy.map_source.calls == 1
    assert (result.labels[:, 16:24] == UNKNOWN).all()  # seen since
    assert np.isfinite(result.heights[:, 16:24]).all()


def test_map_based_waits_for_coverage():
    strategy = MapBased(Heights(), Maps(), coverage=0.9)
    running = run(strategy, 3)
    assert (running.height_map().labels == UNKNOWN).all()
    for frame in list(frames(5))[3:]:
        running.add(frame)
    assert (running.height_map().labels != UNKNOWN).all()


def test_hybrid_takes_the_surer_expert_of_each_kind_of_mistake():
    of_both = Weights(1.0, 1.0, 2.0, 2.0)
    result = run(hybrid(pool=Pool(of_both, of_both, doubt=0.2)), 5).height_map()
    assert (result.labels[25] == 2).all()  # views call pens books, the map is right
    assert (result.sources[25] == FROM_MAP).all()
    views_count_more = Weights(1.0, 1.0, 0.5, 0.5)
    result = run(hybrid(pool=Pool(views_count_more, views_count_more)), 5).height_map()
    assert (result.labels[10:15] == 1).all()
    assert (result.sources[10:15] == FROM_VIEWS).all()
    assert (result.sources[:5] == FROM_BOTH).all()
    np.testing.assert_allclose(result.probabilities.sum(axis=0), 1, atol=1e-5)


def test_hybrid_labels_from_the_first_frame():
    result = run(hybrid(every=10), 1).height_map()
    assert (result.sources[:, :8] == FROM_VIEWS).all()
    assert (result.labels[:, 8:] == UNKNOWN).all()


def test_hybrid_refines_every_so_many_frames():
    strategy = hybrid(every=2)
    running = run(strategy, 5)
    running.height_map()
    running.height_map()
    assert strategy.map_source.calls == 2


def test_hybrid_without_weight_of_the_map_is_view_based():
    views_alone = Weights(1.0, 1.0, 0.0, 0.0)
    mixed = run(hybrid(pool=Pool(views_alone, views_alone)), 3).height_map()
    np.testing.assert_array_equal(mixed.labels, run(view_based(), 3).height_map().labels)


def map_based(**changes):
    return MapBased(Heights(), Maps(), **changes)


@pytest.mark.parametrize(
    ("make", "changes"),
    [
        (view_based, {}),
        (view_based, {"key_frames": EveryNth(2)}),
        (view_based, {"key_frames": ByMotion(distance=12.0)}),
        (hybrid, {}),
        (hybrid, {"every": 3}),
        (hybrid, {"every": 2, "key_frames": EveryNth(3)}),
        (map_based, {}),
        (map_based, {"every": 3}),
        (map_based, {"every": 2, "coverage": 0.7}),
    ],
)
@pytest.mark.parametrize("cut", [1, 3, 4])
def test_a_saved_state_resumes_exactly(make, changes, cut):
    through = run(make(**changes), 5).height_map()
    before = make(**changes).begin()
    shown = list(frames(5))
    for frame in shown[:cut]:
        before.add(frame)
    states = before.states()  # first, as asking for the map must not change how it continues
    after = make(**changes).begin(before.height_map(), states)
    for frame in shown[cut:]:
        after.add(frame)
    result = after.height_map()
    np.testing.assert_array_equal(result.labels, through.labels)
    np.testing.assert_array_equal(result.sources, through.sources)
    np.testing.assert_array_equal(result.probabilities, through.probabilities)


def test_labels_of_a_map_stay_until_there_are_new_ones():
    first = run(view_based(), 2).height_map()
    more = map_based(every=2).begin(first)
    shown = list(frames(4))
    more.add(shown[2])
    kept = more.height_map()
    np.testing.assert_array_equal(kept.labels[:, :16], first.labels[:, :16])
    assert (kept.sources[:, :16] == FROM_VIEWS).all()
    more.add(shown[3])
    assert (more.height_map().sources[:, :16] == FROM_MAP).all()


def test_a_map_alone_can_be_resumed_too():
    first = run(view_based(), 2).height_map()
    more = view_based().begin(first)
    more.add(list(frames(3))[2])
    assert (more.height_map().labels[:, :24] != UNKNOWN).all()


@pytest.mark.parametrize("make", [view_based, hybrid, lambda: MapBased(Heights(), Maps())])
def test_a_map_of_other_classes_is_refused(make):
    other = run(view_based(), 1).height_map()
    object.__setattr__(other, "classes", ("surface", "coin"))
    with pytest.raises(InputError, match="surface, coin"):
        make().begin(other)


def test_sources_of_different_classes_are_refused():
    maps = Maps()
    maps.classes = ("surface", "coin")
    with pytest.raises(ConfigError, match="surface, coin"):
        Hybrid(Heights(), Labels(), Views(), maps)
    views = Views()
    views.classes = maps.classes = ("surface",)
    with pytest.raises(ConfigError, match="only one class, surface"):
        Hybrid(Heights(), Labels(), views, maps)


def test_settings_are_checked():
    for wrong in ({"every": 0}, {"coverage": 2.0}):
        with pytest.raises(ConfigError, match="expected"):
            MapBased(Heights(), Maps(), **wrong)
    with pytest.raises(ConfigError, match="expected"):
        hybrid(every=0)
    with pytest.raises(ConfigError, match="expected"):
        view_based(refresh=-1)
    assert GRID.vertices == 33
