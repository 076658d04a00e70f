import pytest
from hydra.utils import instantiate
from tests.unit.report.stored_runs import IMAGES, LABELLING, STACKS, write_run

from scenefw import config
from scenefw.core.errors import InputError
from scenefw.report.stored import read_runs
from scenefw.report.weights.headline import headline


@pytest.fixture
def runs(tmp_path):
    kinds = {"labelling": LABELLING, "stacks": STACKS, "images": IMAGES}
    return read_runs([write_run(tmp_path / name, figures) for name, figures in kinds.items()])


@pytest.fixture(scope="module")
def summaries():
    """Those of run=headline."""
    chosen = config.compose(["run=headline"]).run.summaries
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
    assert found[""] == ["scenefw", "without learning", "published"]
    assert found["Chamfer, whole: excess (mm) \u2193"] == ["2.1", "14.8", "–"]
    assert found["instance IoU, network of volumes alone \u2191"] == ["0.733", "0.610", "–"]
    [whole] = [name for name in found if name.startswith("Chamfer, whole, as the thesis")]
    assert found[whole] == ["0.019", "–", "0.028"]
    assert found["BCE of expected occupancy \u2193"] == ["0.044", "0.075", "0.089"]
    assert found["instance IoU \u2191"] == ["0.822", "0.610", "–"]
    skill = "log skill of occupancy, 10 draws (%) \u2191"
    assert found[skill] == ["92.0 (90.0 to 94.0)", "40.1", "–"]
    assert found["overlap F (%) \u2191"] == ["90.6", "87.3", "83.3"]
    assert found["objects with F \u2265 0.75 (%) \u2191"] == ["85.0", "76.3", "–"]
    assert found["view-based \u2191"] == ["0.883", "–", "0.889"]
    assert found["map-based \u2191"] == ["0.826", "–", "0.922"]
    assert found["hybrid \u2191"] == ["0.882", "–", "–"]
    names = [name for name in found if name.startswith("**")]
    assert [name.split(",")[0].strip("*") for name in names] == [
        "Simulated stacks",
        "Real images of a depth camera",
        "Labelled height maps",
    ]
    assert "100 views of 50 test scenes, 3 samples each" in names[0]
    assert "occupancy IoU of the zero code alone \u2191" not in found  # the network's card has it


def test_the_commands_stand_below(runs, summaries):
    text = headline(runs, summaries)
    assert text.count("python -m scenefw run=evaluate  # commit 0123456789, seed 7") == 1
    assert text.rstrip().endswith("```")


def test_what_is_there_is_shown(runs, summaries):
    found = rows(headline(runs[1:2], summaries))
    assert "BCE of expected occupancy \u2193" in found
    assert "hybrid \u2191" not in found


def test_foreign_missing_and_double_figures(runs, summaries, tmp_path):
    (other,) = read_runs([write_run(tmp_path / "other", {"train/steps": 3.0})])
    with pytest.raises(InputError, match=r"other/metrics\.json has no figures to show"):
        headline([*runs, other], summaries)
    with pytest.raises(InputError, match="the same figures"):
        headline([*runs, runs[0]], summaries)
    with pytest.raises(InputError, match=r"run\.results"):
        headline([], summaries)
