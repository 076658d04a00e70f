"""What `--list` shows, against what classes themselves say."""

import inspect
import subprocess
import sys

import pytest
from hydra.utils import get_object
from tests.composed import every

from scenefw import docstrings, listing, plugins, registry

SOURCE = '''
class Plain:
    """One line.

    Args:
        first: what it is,
            over two lines.
        second: another (m): with a colon.

    Raises:
        ValueError: never.
    """

    def __init__(self, first, second: float = 2.5, *, third=("a", 1)): ...


class Derived(Plain):
    """Takes what its base takes."""

    first: int


class Further(Plain):
    """Takes more.

    Args:
        second: its own words.
    """

    def __init__(self, first, second=1.0, more=None): ...


def function(one, two=None):
    """One line."""
'''


@pytest.fixture
def package(tmp_path):
    (tmp_path / "some").mkdir()
    (tmp_path / "some" / "module.py").write_text(SOURCE)
    return tmp_path


def test_arguments_are_read_from_source(package):
    found = docstrings.arguments("some.module.Plain", [package / "no", package])
    assert found["first"] == docstrings.Argument(None, "what it is, over two lines.")
    assert found["second"] == docstrings.Argument("2.5", "another (m): with a colon.")
    assert found["third"] == docstrings.Argument("('a', 1)", "")
    assert list(found) == ["first", "second", "third"]
    assert docstrings.arguments("some.module.Derived", [package]) == found
    further = docstrings.arguments("some.module.Further", [package])
    assert further["first"] == found["first"]
    assert further["second"] == docstrings.Argument("1.0", "its own words.")
    assert list(further) == ["first", "second", "more"]
    assert docstrings.arguments("some.module.function", [package])["two"].default == "None"
    assert docstrings.arguments("some.other.Plain", [package]) == {}


@pytest.mark.parametrize("group", ["model", "renderer", "learning", "trainer", "dataset"])
def test_arguments_are_those_of_the_classes(group):
    plugins.activate()
    for path in registry.options(group).values():
        target = listing.composed(path)["_target_"]
        assert set(docstrings.arguments(target, listing.roots())) == set(
            inspect.signature(get_object(target)).parameters
        )


@pytest.mark.exhaustive
def test_options_are_composed_as_hydra_does():
    composed = {
        group: {name: listing.composed(registry.options(group)[name]) for name in options}
        for group, options in every().items()
    }
    expected = every()
    assert len(expected) > 30
    for group, options in expected.items():
        assert composed[group] == {name: node or {} for name, node in options.items()}


def test_one_group_is_shown_with_arguments_and_without_torch(tmp_path):
    code = (
        "import sys; from scenefw.__main__ import main; main(['--list', 'renderer']);"
        "sys.exit(bool({'torch', 'numpy', 'hydra', 'numba'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "renderer=sphere_tracer" in done.stdout
    row = next(line for line in done.stdout.splitlines() if line.startswith("max_steps"))
    assert row.split()[1] == "256"
    assert "run=" in done.stdout
    assert "loss=" not in done.stdout
