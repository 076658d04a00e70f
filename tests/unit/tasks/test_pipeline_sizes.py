"""How many scenes the pipeline judges: few on a laptop, the published numbers everywhere else."""

import pytest

from scenefw import config

PUBLISHED = {"draws": 10, "draw_scenes": 30, "calibration_scenes": 15}


def sizes(*words):
    size = config.compose(words).size
    return {name: size[name] for name in PUBLISHED}


@pytest.mark.parametrize(
    "words", [["run=evaluate"], ["run=evaluate", "scale=thesis"], ["run=pipeline", "scale=thesis"]]
)
def test_figures_are_published_of_the_same_numbers(words):
    assert sizes(*words) == PUBLISHED


def test_the_pipeline_takes_a_first_look_unless_told_otherwise():
    first = sizes("run=pipeline")
    assert first["draws"] == PUBLISHED["draws"]  # rows are named after them
    assert first["draw_scenes"] + first["calibration_scenes"] <= 10
    assert sizes("run=pipeline", "size.draw_scenes=30")["draw_scenes"] == 30
    assert sizes("run=pipeline", "debug=smoke")["calibration_scenes"] == 1
