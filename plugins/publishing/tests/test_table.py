import pytest
from hydra.utils import instantiate
from tests.unit.report.stored_runs import IMAGES, LABELLING, STACKS, write_run

from scenefw import config, plugins
from scenefw.core.errors import InputError
from scenefw_publishing.stored import read_runs
from scenefw_publishing.table import headline


@pytest.fixture
def runs(tmp_path):
    kinds = {"labelling": LABELLING, "stacks": STACKS, "images": IMAGES}
    return read_runs([write_run(tmp_path / name, figures) for name, figures in kinds.items()])


@pytest.fixture(scope="module")
def summaries():
    """Those of run=publish."""
    plugins.activate()
    chosen = config.compose(["run=publish"]).run.summaries
    return [instantiate(node, _convert_="all") for node in chosen.values()]


def rows(text):
    cells = [
        [c.strip() for c in line.strip("|").split("|")]
        for line in text.splitlines()
        if line.startswith("|")
    ]
    return {name: values for name, *values in cells}


def test_ours_beside_no_learning_and_the_published(runs, summaries):
    found = rows(headline(runs, summaries))
    assert found[""] == ["default", "without learning", "published"]
    assert found["Chamfer, whole: excess (mm) \u2193"] == ["2.1", "14.8", "–"]
    assert found["instance IoU \u2191"] == ["0.822", "0.610", "–"]
    assert found["overlap F (%) \u2191"] == ["90.6", "87.3", "83.3"]
    assert found["hybrid \u2191"] == ["0.882", "–", "–"]
    names = [name for name in found if name.startswith("**")]
    assert [name.split(",")[0].strip("*") for name in names] == [
        "Simulated stacks",
        "Real images of a depth camera",
        "Labelled height maps",
    ]
    assert "100 views of 50 test scenes, 3 samples each" in names[0]
    details = ("BCE of expected occupancy \u2193", "view-based \u2191")  # of cards
    assert not set(details) & found.keys()


def test_the_commands_stand_below(runs, summaries):
    text = headline(runs, summaries)
    assert text.count("python -m scenefw run=evaluate  # commit 0123456789, seed 7") == 1
    assert text.rstrip().endswith("```")


def test_what_is_there_is_shown(runs, summaries):
    found = rows(headline(runs[1:2], summaries))
    assert "instance IoU \u2191" in found
    assert "hybrid \u2191" not in found


def test_foreign_missing_and_double_figures(runs, summaries, tmp_path):
    (other,) = read_runs([write_run(tmp_path / "other", {"train/steps": 3.0})])
    with pytest.raises(InputError, match=r"other/metrics\.json has no figures to show"):
        headline([*runs, other], summaries)
    with pytest.raises(InputError, match="the same figures"):
        headline([*runs, runs[0]], summaries)
    with pytest.raises(InputError, match=r"run\.results"):
        headline([], summaries)
