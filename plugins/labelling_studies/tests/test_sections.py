"""What results of labelling look like on the page."""

import pytest
from plugins.labelling_studies.tests.test_bench import strategies
from tests.unit.labelling.fakes import Heights, Maps, Scenes, Views

from scenefw.core.errors import ConfigError
from scenefw.evaluation.several import Several
from scenefw.labelling.pooling import Pool, Weights
from scenefw.noise.gaussian import Gaussian
from scenefw.noise.pose import Jitter
from scenefw.report.blocks import Drawing, Picture
from scenefw.report.presentation import Chapter
from scenefw.report.tables import Table, to_markdown
from scenefw_labelling_studies.bench import Bench
from scenefw_labelling_studies.curves import LabellingCurves
from scenefw_labelling_studies.networks import LabellingNetworks
from scenefw_labelling_studies.noise import LabellingNoise
from scenefw_labelling_studies.pool_weights import WeightsResult
from scenefw_labelling_studies.results import read_scores
from scenefw_labelling_studies.times import LabellingTimes

sections = Chapter("scenefw_labelling_studies.report").sections


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
