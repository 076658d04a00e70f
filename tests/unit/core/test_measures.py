import json

import pytest

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.measures import Measure, join_measures, read_measures, write_measures

CHAMFER = Measure(
    "full", "Chamfer, whole", "mm", 1, "lower", 1000.0, 0.028, "none/chamfer", "chamfer_floor"
)


def test_a_figure_in_its_printed_unit():
    assert CHAMFER.shown(0.0123) == pytest.approx(12.3)
    assert CHAMFER.text(0.01234) == "12.3"
    assert Measure("IoU").text(0.5) == "0.500"


def test_figures_that_a_measure_names_move_with_it():
    found = join_measures([("a", {"chamfer": CHAMFER}), ("b", {"chamfer": Measure("bare")})])
    assert found["a/chamfer"].trivial == "a/none/chamfer"
    assert found["a/chamfer"].floor == "a/chamfer_floor"
    assert found["b/chamfer"] == Measure("bare")


def test_what_is_written_is_read(tmp_path):
    measures = {"chamfer": CHAMFER, "plain": Measure("F ≥ 75", digits=0)}
    write_measures(tmp_path, measures)
    assert read_measures(tmp_path) == measures
    plain = json.loads((tmp_path / "measures.json").read_text(encoding="utf-8"))
    assert plain["plain"] == {"heading": "F ≥ 75", "digits": 0}
    assert read_measures(tmp_path / "nothing") == {}


@pytest.mark.parametrize(
    "text", ["{", "[1]", '{"a": 1}', '{"a": {}}', '{"a": {"heading": "a", "better": "up"}}']
)
def test_a_damaged_file(tmp_path, text):
    (tmp_path / "measures.json").write_text(text)
    with pytest.raises(InputError, match=r"measures\.json is damaged"):
        read_measures(tmp_path)


def test_changes():
    assert CHAMFER.changed({"name": "other"}).name == "other"
    with pytest.raises(ConfigError, match="no 'title'; give heading"):
        CHAMFER.changed({"title": "x"})
    with pytest.raises(ConfigError, match="expected lower, higher or null"):
        CHAMFER.changed({"better": "up"})
