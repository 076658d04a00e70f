"""Results of any evaluation as tables, part by part, beside what others have."""

from dataclasses import dataclass, field

import pytest

from scenefw.core.measures import Measure
from scenefw.evaluation.several import Several
from scenefw.report.blocks import Section, Text
from scenefw.report.presentation import Figures, figure_table, sections_by_class


@dataclass(frozen=True)
class Found:
    figures: dict
    measures: dict = field(default_factory=dict)


class Evaluation:
    def __init__(self, result):
        self.result = result

    def run(self, track):
        return self.result


def test_figures_without_measures_are_printed_bare(tmp_path):
    (section,) = Figures().sections(Found({"some_figure": 0.25}), tmp_path)
    (table,) = section.blocks
    assert [column.name for column in table.columns] == ["value"]
    assert table.rows == (("some_figure", ("0.2500",)),)


def test_measures_say_unit_floor_and_what_others_have():
    measures = {
        "error": Measure(
            "e", "error of all", "mm", 1, "lower", 1000.0, 0.002, "none/error", "error_floor"
        ),
        "none/error": Measure("e", "error of all", "mm", 1, "lower", 1000.0),
    }
    figures = {"error": 0.0012, "error_floor": 0.0005, "none/error": 0.02}
    table = figure_table(Found(figures, measures))
    assert [column.name for column in table.columns] == ["value", "without learning", "published"]
    assert table.rows == (
        ("error of all (mm; floor 0.5) ↓", ("1.2", "20.0", "2.0")),
        ("error_floor", ("0.0005", None, None)),
        ("error of all (mm) ↓", ("20.0", None, None)),
    )
    unlike = {**measures, "error": measures["none/error"]}
    rows = dict(figure_table(Found(figures, unlike)).rows)
    assert rows["error of all (mm) ↓ (none/error)"][0] == "20.0"  # two of one name


def test_several_results_part_by_part(tmp_path):
    class Other(Found):
        pass

    def shown(result, folder):
        assert folder == tmp_path
        return (Section("own words", (Text(str(result.figures["a"])),)),)

    parts = {"first_part": Evaluation(Found({"a": 1.0})), "other": Evaluation(Other({"a": 2.0}))}
    result = Several(parts).run()
    sections = sections_by_class(result, tmp_path, {Other: shown})
    assert [section.title for section in sections] == ["first part", "own words"]
    assert sections[1].blocks == (Text("2.0"),)


def test_parts_keep_what_is_said_of_their_figures():
    measure = Measure("IoU", trivial="none/iou")
    result = Several(
        {"p": Evaluation(Found({"iou": 0.5, "none/iou": 0.1}, {"iou": measure}))}
    ).run()
    assert result.figures == {"p/iou": 0.5, "p/none/iou": 0.1}
    (row, _) = figure_table(result).rows
    assert row == ("IoU", ("0.500", "0.100"))


@pytest.mark.parametrize("better", ["lower", "higher"])
def test_arrows_show_the_better_side(better):
    table = figure_table(Found({"a": 1.0}, {"a": Measure("A", better=better)}))
    assert table.rows[0][0] == {"lower": "A ↓", "higher": "A ↑"}[better]
