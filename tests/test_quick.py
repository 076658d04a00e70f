"""What `make quick` leaves out is marked, and the rest is chosen by that mark."""

from pathlib import Path

import pytest
from tests.conftest import SLOW, SLOW_FILES

ROOT = Path(__file__).parents[1]


def test_the_marker_is_registered(pytestconfig):
    assert any(line.startswith("slow:") for line in pytestconfig.getini("markers"))
    assert pytestconfig.getoption("strict_markers")


def test_quick_tests_are_chosen_by_the_marker():
    recipe = (ROOT / "Makefile").read_text().split("\nquick:")[1].split("\n\n")[0]
    assert '-m "not slow"' in recipe


@pytest.mark.parametrize("name", SLOW)
def test_folders_of_slow_tests_exist(name):
    assert list((ROOT / "tests" / "unit" / name).rglob("test_*.py"))


@pytest.mark.parametrize("name", SLOW_FILES)
def test_files_of_slow_tests_exist(name):
    assert list((ROOT / "tests").rglob(f"{name}.py"))


def test_what_runs_a_command_is_slow(scenefw, request):
    assert request.node.get_closest_marker("slow")


def test_what_runs_none_is_not(request):
    assert not request.node.get_closest_marker("slow")
