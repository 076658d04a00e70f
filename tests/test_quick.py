"""What `make quick` and `make test` leave out is marked; continuous integration runs everything."""

import re
from pathlib import Path

import pytest
from tests.conftest import SLOW, SLOW_FILES

ROOT = Path(__file__).parents[1]
MAKEFILE = (ROOT / "Makefile").read_text()
CHOICES = {"quick": ["not slow and not exhaustive"], "test": ["not exhaustive"], "test-all": []}


@pytest.mark.parametrize("marker", ["slow", "exhaustive"])
def test_the_marker_is_registered(pytestconfig, marker):
    assert any(line.startswith(f"{marker}:") for line in pytestconfig.getini("markers"))
    assert pytestconfig.getoption("strict_markers")


@pytest.mark.parametrize("target", CHOICES)
def test_tests_are_chosen_by_the_marker_alone(target):
    assert re.findall(rf'^{target}: CHOICE := -m "(.*)"$', MAKEFILE, re.M) == CHOICES[target]
    assert "\n\t$(TESTS) $(CHOICE) $(PYTEST)\n" in MAKEFILE
    assert "\ntest quick test-all: types tests\n" in MAKEFILE


def test_nothing_else_leaves_tests_out(pytestconfig):
    (command,) = re.findall(r"^TESTS := (.*)$", MAKEFILE, re.MULTILINE)
    assert command == "$(THREADS) $(BIN)/python -m pytest -n 2 --dist worksteal"
    assert pytestconfig.getini("testpaths") == ["tests", "plugins"]
    options = pytestconfig.getini("addopts")
    assert not [word for word in options if word.startswith(("-m", "-k", "--ignore", "--deselect"))]


def test_continuous_integration_runs_all():
    commands = (ROOT / ".ci" / "run").read_text().splitlines()
    assert commands[-1] == "exec make test-all"


def test_tests_lie_where_pytest_looks():
    folders = [path for path in ROOT.iterdir() if path.is_dir() and path.name[0] != "."]
    found = {path.name for path in folders if next(path.rglob("test_*.py"), None)}
    assert found == {"tests", "plugins"}


def test_folders_and_files_of_slow_tests_exist():
    assert [n for n in SLOW if not any((ROOT / "tests" / "unit" / n).rglob("test_*.py"))] == []
    assert [name for name in SLOW_FILES if not any((ROOT / "tests").rglob(f"{name}.py"))] == []


def test_what_runs_a_command_is_slow(scenefw, request):
    assert request.node.get_closest_marker("slow")


def test_what_runs_none_is_not(request):
    assert not request.node.get_closest_marker("slow")
