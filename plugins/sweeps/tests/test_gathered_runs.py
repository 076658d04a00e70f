import csv
import json

import pytest

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.measures import Measure, write_measures
from scenefw_sweeps.gathered_runs import GatheredRuns
from scenefw_sweeps.runs import runs_sections

MEASURES = {
    "iou": Measure("intersection", better="higher"),
    "chamfer": Measure("Chamfer", unit="mm", digits=1, factor=1000.0),
    "noisy/iou": Measure("IoU"),
}
COLUMNS = {
    "iou": {"heading": "IoU"},
    "chamfer": {},
    "noisy/iou": {},
    "nobody/has": {},
    "seen": None,
}


def write_run(folder, overrides, figures):
    folder.mkdir(parents=True)
    (folder / "run.json").write_text(json.dumps({"overrides": overrides}))
    (folder / "metrics.json").write_text(json.dumps(figures))
    write_measures(folder, MEASURES)


@pytest.fixture
def sweep(tmp_path):
    for number in range(11):
        words = ["experiment=e", f"model.widths=[{number}]", "seed=3", f"paths.output={number}"]
        write_run(tmp_path / str(number), words, {"iou": number / 10, "chamfer": 0.001 * number})
    return tmp_path


def test_runs_are_named_by_what_they_do_not_share(sweep):
    result = GatheredRuns(sweep, COLUMNS).run()
    assert [run.name for run in result.runs] == [f"model.widths=[{n}]" for n in range(11)]
    assert result.shared == ("experiment=e", "seed=3")
    assert result.figures["model.widths=[10]/iou"] == 1.0
    assert result.measures["model.widths=[10]/iou"].heading == "IoU"


def test_the_table_has_a_row_per_run_and_leaves_gaps(sweep):
    figures = {"iou": 0.5, "noisy/iou": 0.25, "seen": 1.0}
    write_run(sweep / "11", ["experiment=e", "model.widths=[11]", "seed=3"], figures)
    (section,) = runs_sections(GatheredRuns(sweep, COLUMNS).run(), sweep)
    table, drawing = section.blocks
    assert [column.heading for column in table.columns] == ["IoU ↑", "Chamfer (mm)", "IoU, noisy"]
    assert table.rows[10] == ("model.widths=[10]", (1.0, pytest.approx(10.0), None))
    assert table.rows[11] == ("model.widths=[11]", (0.5, None, 0.25))
    assert "experiment=e seed=3" in table.note
    assert drawing.svg.startswith("<svg")
    assert drawing.caption == "Figures of each setting."


def test_the_csv_has_settings_and_figures(sweep):
    runs_sections(GatheredRuns(sweep, COLUMNS).run(), sweep)
    with (sweep / "runs.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 11
    assert rows[3]["model.widths"] == "[3]"
    assert (float(rows[3]["iou"]), float(rows[3]["chamfer"])) == (0.3, 0.003)


def test_without_a_figure_asked_for_those_that_differ_are_shown(sweep):
    result = GatheredRuns(sweep, {"nobody/has": {}}).run()
    headings = {name: measure.heading for name, measure in result.columns.items()}
    assert headings == {"iou": "intersection, iou", "chamfer": "Chamfer, chamfer"}


def test_runs_that_broke_off_are_left_out(sweep):
    (sweep / "10" / "metrics.json").unlink()
    assert len(GatheredRuns(sweep, COLUMNS).run().runs) == 10


def test_a_run_without_overrides_has_the_name_of_its_folder(tmp_path):
    write_run(tmp_path / "mine", [], {"iou": 0.1})
    assert GatheredRuns(tmp_path, COLUMNS).run().runs[0].name == "mine"


def test_trainings_have_no_measures_of_their_own(tmp_path):
    for number in range(2):
        write_run(tmp_path / str(number), [f"model.widths=[{number}]"], {"val/miou": number / 4})
        (tmp_path / str(number) / "measures.json").unlink()
    result = GatheredRuns(tmp_path, {"val/miou": {"heading": "mean IoU"}}).run()
    assert result.figures == {"model.widths=[0]/val/miou": 0.0, "model.widths=[1]/val/miou": 0.25}
    (tmp_path / "0" / "metrics.json").write_text('{"iou": 1.0, "val/miou": 0.5}')
    with pytest.raises(InputError, match=r"measures\.json"):
        GatheredRuns(tmp_path, {"val/miou": {}}).run()


def test_what_is_missing_or_damaged_is_one_line(tmp_path):
    with pytest.raises(ConfigError, match="input=FOLDER"):
        GatheredRuns(None, COLUMNS)
    with pytest.raises(ConfigError, match=r"columns\.iou: a measure has no 'title'"):
        GatheredRuns(tmp_path, {"iou": {"title": "IoU"}})
    with pytest.raises(InputError, match=r"metrics\.json"):
        GatheredRuns(tmp_path, COLUMNS).run()
    write_run(tmp_path / "0", [], {})
    with pytest.raises(InputError, match="none of the figures iou, chamfer"):
        GatheredRuns(tmp_path, COLUMNS).run()
    (tmp_path / "0" / "metrics.json").write_text('{"iou": ')
    with pytest.raises(InputError, match="damaged"):
        GatheredRuns(tmp_path, COLUMNS).run()


def test_runs_of_earlier_versions_do_not_say_what_their_figures_are(tmp_path):
    write_run(tmp_path / "0", [], {"iou": 0.1})
    (tmp_path / "0" / "measures.json").unlink()
    with pytest.raises(InputError, match=r"no measures\.json .* run the sweep again"):
        GatheredRuns(tmp_path, COLUMNS).run()
