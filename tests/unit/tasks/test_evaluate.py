"""The task runs what it is given, prints its tables, and leaves a page and measures."""

import json

import pytest

from scenefw.core.measures import Measure
from scenefw.report.blocks import Picture, Section
from scenefw.report.page import Page
from scenefw.report.presentation import Figures
from scenefw.report.tables import Table
from scenefw.tasks.evaluate import Evaluate


class _Result:
    figures = {"overlap_f": 0.5, "reference/overlap_f": 0.75}  # noqa: RUF012
    measures = {"overlap_f": Measure("overlap F", unit="%", factor=100.0)}  # noqa: RUF012


class _Evaluation:
    def run(self, track):
        assert list(track([1, 2], "things")) == [1, 2]
        return _Result()


class _Gallery:
    def show(self):
        return (Picture("gallery/a.jpg", "scene 1"),)


def test_figures_page_and_tables(tmp_path, capsys):
    out = tmp_path / "out"
    assert (
        Evaluate(_Evaluation(), Figures(), _Gallery(), Page("Scores"), out).run() == _Result.figures
    )
    printed = capsys.readouterr().out
    assert "reference/overlap_f" in printed
    assert "0.7500" in printed
    page = (out / "report.html").read_text()
    assert page.index("Scores") < page.index("Predictions beside") < page.index("gallery/a.jpg")
    measures = json.loads((out / "measures.json").read_text())
    assert measures == {"overlap_f": {"heading": "overlap F", "unit": "%", "factor": 100.0}}


def test_without_examples_there_is_no_section_of_them(tmp_path):
    Evaluate(_Evaluation(), Figures(), None, Page(), tmp_path).run()
    assert "Predictions" not in (tmp_path / "report.html").read_text()


class _Tables:
    def sections(self, result, folder):
        return [
            Section(title, (Table(title, (), ((title.lower(), ()),)),))
            for title in ("Skill", "Shapes")
        ]


def test_the_console_shows_the_first_table_and_names_the_others(tmp_path, capsys):
    Evaluate(_Evaluation(), _Tables(), None, Page(), tmp_path).run()
    printed = capsys.readouterr().out
    assert "skill" in printed
    assert "shapes" not in printed
    assert "more tables: Shapes" in printed
    assert "shapes" in (tmp_path / "report.html").read_text()


PLUGIN = """
class Result:
    figures = {"size": 0.012, "none/size": 0.5}
    measures = {}


class Sizes:
    def run(self, track=None):
        return Result()
"""


@pytest.mark.parametrize("presentation", [None, "sizes"])
def test_an_evaluation_of_a_plugin_is_shown(scenefw, tmp_path, presentation):
    package = tmp_path / "plugins" / "sizes" / "src" / "scenefw_sizes"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "sizes.py").write_text(PLUGIN)
    conf = tmp_path / "plugins" / "sizes" / "conf"
    (conf / "evaluation").mkdir(parents=True)
    text = "# Sizes of things\n_target_: scenefw_sizes.sizes.Sizes\n"
    if presentation:
        text += "defaults:\n  - override /presentation@_global_.presentation: sizes\n"
        (conf / "presentation").mkdir()
        shows = "# Sizes in words\n_target_: scenefw_sizes.shown.Shown\n"
        (conf / "presentation" / "sizes.yaml").write_text(shows)
        (package / "shown.py").write_text(
            "from scenefw.report.blocks import Section, Text\n\n\n"
            "class Shown:\n"
            "    def sections(self, result, folder):\n"
            '        return [Section("Sizes", (Text("They are small."),))]\n'
        )
    (conf / "evaluation" / "sizes.yaml").write_text(text)
    project = '[project.entry-points."scenefw.plugins"]\nsizes = "scenefw_sizes"\n'
    (tmp_path / "plugins" / "sizes" / "pyproject.toml").write_text(project)
    done = scenefw("run=evaluate", "evaluation=sizes", "device=cpu", "paths.output=out")
    assert done.returncode == 0, done.stderr[-3000:]
    page = (tmp_path / "out" / "report.html").read_text()
    assert ("They are small." in page) == (presentation is not None)
    assert ("0.0120" in page) == (presentation is None)
