"""What results of labelling look like on the page."""

import numpy as np
import pytest
from tests.unit.evaluation.labelling.test_bench import strategies
from tests.unit.labelling.fakes import CLASSES, Heights, Maps, Scenes, Views, truth

from scenefw.core.errors import ConfigError
from scenefw.core.labels import FROM_BOTH, FROM_MAP, FROM_VIEWS, NO_SOURCE
from scenefw.evaluation.labelling.bench import Bench
from scenefw.evaluation.labelling.curves import LabellingCurves
from scenefw.evaluation.labelling.networks import LabellingNetworks
from scenefw.evaluation.labelling.noise import LabellingNoise
from scenefw.evaluation.labelling.pool_weights import WeightsResult
from scenefw.evaluation.labelling.results import read_scores
from scenefw.evaluation.labelling.times import LabellingTimes
from scenefw.evaluation.several import Several
from scenefw.labelling.pooling import Pool, Weights
from scenefw.noise.gaussian import Gaussian
from scenefw.noise.pose import Jitter
from scenefw.report.blocks import Drawing, Picture
from scenefw.report.labelling.pictures import (
    SOURCES,
    UNSEEN,
    error_picture,
    label_picture,
    map_picture,
    source_picture,
)
from scenefw.report.palette import class_colours
from scenefw.report.presentation import Chapter
from scenefw.report.tables import Table, to_markdown

sections = Chapter("scenefw.report.labelling").sections


def tables(shown):
    return {b.title: b for s in shown for b in s.blocks if isinstance(b, Table)}


def test_curves_beside_the_thesis(tmp_path):
    result = LabellingCurves(Bench(Scenes(), strategies()), frames=5, steps=5).run()
    shown = sections(result, tmp_path)
    assert read_scores(tmp_path / "curves.csv") == result.scores
    found = tables(shown)
    final = found["Mean IoU after 5 frames, 2 scenes"]
    rows = dict(final.rows)
    assert rows["hybrid"][0] == pytest.approx(result.scores.final("hybrid").mean)
    assert rows["thesis, map_based"][:2] == (0.922, "(0.910, 0.930)")
    assert len(found["Mean IoU by number of frames"].rows) == 5
    assert "The hybrid against the others, paired" in found
    (drawing,) = [b for b in shown[0].blocks if isinstance(b, Drawing)]
    assert drawing.svg.startswith("<svg")
    assert "thesis, map_based" in drawing.svg
    (picture,) = [b for b in shown[-1].blocks if isinstance(b, Picture)]
    assert (tmp_path / picture.path).stat().st_size > 1000
    for table in found.values():
        lines = [line for line in to_markdown(table).splitlines() if line.startswith("|")]
        assert len(lines) == len(table.rows) + 2


def test_noise_maps(tmp_path):
    bench = Bench(Scenes(), strategies())
    result = LabellingNoise(bench, 2, [0.0, 0.5], [0.0, 0.01, 0.02], Jitter, Gaussian).run()
    (section,) = sections(result, tmp_path)
    table = tables([section])["Mean IoU under noise (figure 4.26)"]
    assert len(table.rows) == 6
    for _, cells in table.rows:
        assert cells[-2] == "–" or cells[-2].startswith("(")
    drawings = [b.svg for b in section.blocks if isinstance(b, Drawing)]
    assert len(drawings) == 2
    assert "hybrid" in drawings[0]
    assert (tmp_path / "noise.csv").is_file()


def test_networks_beside_table_4_1(tmp_path):
    result = LabellingNetworks(Scenes(), Views(), Maps(), Heights(), views=1, frames=5).run()
    (section,) = sections(result, tmp_path)
    (table,) = section.blocks
    rows = dict(table.rows)
    assert rows["thesis, views"][:3] == (pytest.approx(0.7825), 0.95, 0.99)
    assert rows["thesis, maps"][3] is None  # it has no books
    assert rows["maps (2)"][2:] == pytest.approx((1.0, 0.5, 1 / 6))


def test_times_beside_table_4_2(tmp_path):
    result = LabellingTimes(Bench(Scenes(), strategies()), frames=2, scenes=1).run()
    (section,) = sections(result, tmp_path)
    (table,) = section.blocks
    rows = dict(table.rows)
    assert rows["thesis"][:4] == (6.13, 1.78, 77.0, 31.05)
    assert rows["map_based"][2] is None
    assert "Peak memory" in table.note


def test_weights_ready_for_the_command_line(tmp_path):
    result = WeightsResult(
        Pool(Weights(0.5, 1.0, 0.0, 1.0)), {"views": 0.8, "map": 0.9, "pool": 0.95}, 100, 2
    )
    (section,) = sections(result, tmp_path)
    assert "labelling.hybrid.pool.surface.views_poor=0.5" in section.blocks[-1].text


def test_pictures_show_each_vertex_in_its_colour():
    colours = class_colours(3)
    labels = np.array([[0, 2], [-1, 7]])
    picture = label_picture(labels, 3)
    assert picture[0, 1] == pytest.approx(colours[2])
    assert picture[1, 0] == pytest.approx(UNSEEN)
    assert picture[1, 1] == pytest.approx(UNSEEN)
    errors = error_picture(np.array([[0, 1, -1, 1]]), np.array([[0, 0, 0, -1]]))[0]
    assert len(np.unique(errors[:3], axis=0)) == 3
    assert errors[3] == pytest.approx(errors[0])
    sources = source_picture(np.array([[NO_SOURCE, FROM_VIEWS, FROM_MAP, FROM_BOTH]], np.uint8))[0]
    expected = [UNSEEN, *(colour for _, colour in SOURCES.values())]
    np.testing.assert_allclose(sources, expected, atol=1e-6)


def test_a_map_of_its_own():
    whole = truth()
    bare = map_picture(whole)
    object.__setattr__(whole, "sources", np.full(whole.labels.shape, FROM_BOTH, np.uint8))
    picture = map_picture(whole)
    assert bare.shape[0] >= 512
    assert picture.shape[2] == 3
    assert picture.min() >= 0
    assert picture.max() <= 1
    assert len(class_colours(len(CLASSES))) == 3


def test_several_results_on_one_page(tmp_path):
    parts = {
        "networks": LabellingNetworks(Scenes(), Views(), Maps(), Heights(), views=1, frames=2),
        "times": LabellingTimes(Bench(Scenes(), strategies()), frames=1, scenes=1),
        "noise": None,
    }
    result = Several(parts).run()
    assert [s.title for s in sections(result, tmp_path)] == ["Networks", "Time and memory"]
    assert result.figures["times/scenes"] == 1
    with pytest.raises(ConfigError, match="nothing"):
        Several({"noise": None})
