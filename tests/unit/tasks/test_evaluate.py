"""The task runs what it is given, prints its tables, and leaves a page."""

from scenefw.report.blocks import Picture
from scenefw.report.page import Page
from scenefw.tasks.evaluate import Evaluate


class _Result:
    figures = {"overlap_f": 0.5, "reference/overlap_f": 0.75}  # noqa: RUF012


class _Evaluation:
    def run(self, track):
        assert list(track([1, 2], "things")) == [1, 2]
        return _Result()


class _Gallery:
    def show(self):
        return (Picture("gallery/a.jpg", "scene 1"),)


def test_figures_page_and_tables(tmp_path, capsys):
    task = Evaluate(_Evaluation(), Page("Scores"), tmp_path / "out", _Gallery())
    assert task.run() == _Result.figures
    printed = capsys.readouterr().out
    assert "reference/overlap_f" in printed
    assert "0.7500" in printed
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Scores" in page
    assert "gallery/a.jpg" in page


def test_gallery_is_optional(tmp_path):
    Evaluate(_Evaluation(), Page(), tmp_path).run()
    assert "Predictions" not in (tmp_path / "report.html").read_text()
