import pytest
from tests.unit.learning import tiny
from tests.unit.report.stored_runs import IMAGES, LABELLING, STACKS, write_run

from scenefw import registry
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.types import GridSpec
from scenefw.learning.checkpoint import SEGMENTATION, save_checkpoint, shipped_checkpoint
from scenefw.learning.provenance import read_provenance
from scenefw.report.blocks import Code, Points, Text
from scenefw.report.tables import Table
from scenefw_publishing.cards import card_sections
from scenefw_publishing.stored import read_runs
from scenefw_publishing.summary import Summary

FIRST = {"steps": 100, "samples": 800, "seconds": 600.0, "data": {"stacks": 50}, "command": "first"}
SECOND = {
    "steps": 10,
    "samples": 80,
    "seconds": 60.0,
    "epochs": 0.8,
    "data": {"stacks": 60, "scattered": 40},
    "noise": ["kinect"],
    "losses": {"tsdf": 1.0, "mmd": 0.4},
    "command": "second",
    "started_from": {"file": "first.safetensors", "sha256": "abcdef0123456789", **FIRST},
}


@pytest.fixture(scope="module")
def words():
    return registry.build("card", "shape_instance")


@pytest.fixture
def weights(tmp_path):
    def write(metadata, **options):
        model, path = tiny.network(), tmp_path / "w.safetensors"
        save_checkpoint(path, model, model.recipe, GridSpec(8), metadata, **options)
        return read_provenance(path)

    return write


def blocks(sections, kind, title=None):
    return [
        b for s in sections if title in (None, s.title) for b in s.blocks if isinstance(b, kind)
    ]


def cells(table):
    return dict(table.rows)


def test_trainings_in_the_order_of_time_and_their_sums(weights):
    (table,) = blocks(card_sections(weights(SECOND)), Table, "Training")
    found = cells(table)
    assert [column.name for column in table.columns] == ["1", "2", "all"]
    assert found["steps"] == ("100", "10", "110")
    assert found["samples"] == ("800", "80", "880")
    assert found["minutes"] == ("10", "1", "11")
    assert found["data"] == (
        "50 scenes of stacks",
        "60 scenes of stacks, 40 scenes of scattered",
        "",
    )
    assert found["noise"] == ("not recorded", "kinect", "")
    told = cells(blocks(card_sections(weights(SECOND | {"noise": "1 mm"})), Table, "Training")[0])
    assert told["noise"] == ("not recorded", "1 mm", "")  # in words
    assert found["losses and weights"][1] == "tsdf 1.0, mmd 0.4"
    assert found["started from"][:2] == ("random weights", "first.safetensors (abcdef0123)")
    (code,) = blocks(card_sections(weights(SECOND)), Code, "Training")
    assert code.lines == ("first", "second")


def test_a_setting_of_a_command_that_is_called_otherwise_today_is_told(weights):
    old = SECOND | {"command": "python -m scenefw 'learning.fresh=[head]'"}
    (table,) = blocks(card_sections(weights(old)), Table, "Training")
    assert "learning.fresh of a command is called learning.reinitialise today" in table.note
    (table,) = blocks(card_sections(weights(SECOND)), Table, "Training")
    assert "called" not in table.note


def test_trainings_that_the_file_does_not_know_of(weights, words):
    sections = card_sections(weights(FIRST), words, before=[{"steps": 5}], notes=["Made by hand."])
    (table,) = blocks(sections, Table, "Training")
    assert cells(table)["steps"] == ("5", "100", "105")
    assert "Made by hand." in blocks(sections, Points, "Limits")[0].points


def test_figures_of_these_weights_beside_the_published(weights, words, tmp_path):
    provenance = weights(FIRST)
    used = {"w.safetensors": provenance.digest}
    folders = [write_run(tmp_path / "a", STACKS, used), write_run(tmp_path / "b", IMAGES)]
    sections = card_sections(provenance, words, read_runs(folders))
    stacks, images = blocks(sections, Table, "Figures")
    assert cells(stacks)["occupancy IoU of the zero code alone \u2191"] == ("0.796", None, None)
    assert cells(stacks)["BCE of expected occupancy \u2193"] == ("0.326", "0.075", "0.089")
    assert cells(images)["overlap F (%) \u2191"] == ("90.6", "87.3", "83.3")
    known, unknown = blocks(sections, Code, "Figures")
    assert len(known.lines) == 1
    assert "did not record its weights" in unknown.lines[1]


def test_figures_of_other_weights_or_of_another_kind(weights, words, tmp_path):
    provenance = weights(FIRST)
    other = write_run(tmp_path / "other", STACKS, {"x.safetensors": "0" * 64})
    with pytest.raises(InputError, match=r"other weights \(x\.safetensors\)"):
        card_sections(provenance, words, read_runs([other]))
    labels = write_run(tmp_path / "labels", LABELLING)
    with pytest.raises(InputError, match="no figures to show here"):
        card_sections(provenance, words, read_runs([labels]))


def test_figures_of_earlier_versions_have_to_be_found_anew(weights, words, tmp_path):
    provenance = weights(FIRST)
    run = write_run(tmp_path / "old", STACKS, {"w.safetensors": provenance.digest})
    (run / "measures.json").unlink()
    with pytest.raises(InputError, match=r"no measures\.json .* run that evaluation again"):
        card_sections(provenance, words, read_runs([run]))


@pytest.mark.parametrize(("name", "tables"), [("label_views", 2), ("label_maps", 1)])
def test_shipped_networks_of_labels(tmp_path, name, tables):
    provenance = read_provenance(shipped_checkpoint(name))
    runs = read_runs([write_run(tmp_path / "run", LABELLING)])
    found = blocks(card_sections(provenance, registry.build("card", name), runs), Table, "Figures")
    assert len(found) == tables
    assert cells(found[-1])["hybrid \u2191"] == ("0.882", None, None)
    if name == "label_views":
        assert cells(found[0])["IoU of surface \u2191"] == ("0.999", None, "0.990")


def test_without_words_the_card_has_the_facts_alone(weights, tmp_path):
    provenance = weights({"input": "sound", **FIRST}, task=SEGMENTATION)
    run = write_run(tmp_path / "run", IMAGES, {"w.safetensors": provenance.digest})
    sections = card_sections(provenance, None, read_runs([run]), notes=["Only whispers."])
    assert [s.title for s in sections] == ["The network", "Limits", "Training", "Figures"]
    (text,) = blocks(sections, Text, "The network")
    assert "conf/card/NAME.yaml with task: segmentation and input: sound" in text.text
    (table,) = blocks(sections, Table, "Figures")
    assert cells(table)["overlap F (%) \u2191"] == ("90.6", "87.3", "83.3")


def test_rows_of_a_summary_are_changed_and_left_out(tmp_path):
    (run,) = read_runs([write_run(tmp_path / "run", IMAGES)])
    entries = {"overlap_f": {"name": "F", "unit": ""}, "boundary_f": None, "count_error": {}}
    summary = Summary("Images", "{images:.0f} images", ("overlap_f",), entries)
    part = summary.within(run)
    assert part.title == "45 images"
    assert [name for name, _ in part.rows()] == ["F \u2191", "objects too many or too few \u2193"]
    with pytest.raises(ConfigError, match=r"measure overlap_f of a summary: .*'words'"):
        Summary("Images", "", (), {"overlap_f": {"words": "F"}})


def test_rows_of_earlier_names_are_not_left_out_silently(tmp_path):
    old = {name.replace("drawn_codes", "scenefw"): value for name, value in STACKS.items()}
    (run,) = read_runs([write_run(tmp_path / "run", old)])
    part = Summary("Stacks", "", ("chamfer_full",), {"draws/drawn_codes/log_skill": {}}).within(run)
    with pytest.raises(InputError, match="has draws/scenefw/log_skill, which is") as told:
        part.rows()
    assert "\n" not in str(told.value)


def test_without_results_the_card_says_so(weights):
    (text,) = blocks(card_sections(weights(FIRST)), Text, "Figures")
    assert "None" in text.text
