import functools

import pytest
from hydra.utils import instantiate
from tests.unit.report.stored_runs import IMAGES, STACKS, write_run

from scenefw import config, plugins
from scenefw.core.errors import InputError, StorageError
from scenefw.learning.checkpoint import shipped_checkpoint
from scenefw.learning.provenance import digest
from scenefw_publishing import headline

MARKED = "# Title\n\n<!-- headline -->\nold\n<!-- /headline -->\n\n| a | table |\n"


@functools.cache
def summaries():
    """Those of run=publish."""
    plugins.activate()
    return instantiate(config.compose(["run=publish"]).run.summaries, _convert_="all")


def Headline(results, document):  # noqa: N802
    return headline.Headline(results, summaries(), document)


@pytest.fixture
def document(tmp_path):
    path = tmp_path / "README.md"
    path.write_text(MARKED)
    return path


def test_the_table_is_written_anew_and_nothing_else(document, tmp_path):
    results = [write_run(tmp_path / "a", STACKS), write_run(tmp_path / "b", IMAGES)]
    assert Headline(results, document).run() == {"runs": 2.0}
    once = document.read_text()
    assert once.startswith("# Title\n\n<!-- headline -->\n**Figures of the weights that ship**\n")
    assert once.endswith("<!-- /headline -->\n\n| a | table |\n")
    assert "\nold\n" not in once
    Headline(results[::-1], document).run()
    assert document.read_text() == once


def test_parts_that_were_not_measured_again_stay(document, tmp_path):
    """And are replaced, in their place, when they are."""
    both = [write_run(tmp_path / "a", STACKS), write_run(tmp_path / "b", IMAGES)]
    Headline(both, document).run()
    once = document.read_text()
    Headline(both[:1], document).run()
    assert document.read_text() == once
    better = IMAGES | {"overlap_f": 0.951}
    Headline([write_run(tmp_path / "c", better)], document).run()
    again = document.read_text()
    assert "| overlap F (%) \u2191 | 95.1 |" in again
    changed = set(again.splitlines()) ^ set(once.splitlines())
    assert all("overlap F" in line or line.startswith("python -m") for line in changed)


def test_figures_of_weights_that_were_replaced_do_not_stay(document, tmp_path):
    shipped = {"simstack.safetensors": digest(shipped_checkpoint())}
    Headline([write_run(tmp_path / "a", STACKS, shipped)], document).run()
    other = document.read_text().replace(shipped["simstack.safetensors"][:10], "0123456789")
    document.write_text(other)
    with pytest.raises(InputError, match=r"'Stacks' in the table are of another simstack"):
        Headline([write_run(tmp_path / "b", IMAGES)], document).run()
    assert document.read_text() == other


def test_wrong_results_or_documents_leave_all_as_it_was(document, tmp_path):
    with pytest.raises(InputError, match="no figures at"):
        Headline([tmp_path / "nothing"], document).run()
    assert document.read_text() == MARKED
    document.write_text("no place")
    with pytest.raises(StorageError, match="<!-- headline -->"):
        Headline([], document).run()


def test_figures_of_weights_that_do_not_ship(document, tmp_path):
    shipped = {"simstack.safetensors": digest(shipped_checkpoint())}
    Headline([write_run(tmp_path / "a", STACKS, shipped)], document).run()
    other = write_run(tmp_path / "b", IMAGES, {"mine.safetensors": "0" * 64})
    with pytest.raises(InputError, match=r"mine\.safetensors, which are not the shipped weights"):
        Headline([tmp_path / "a", other], document).run()


def test_command_line(scenefw, document, tmp_path):
    write_run(tmp_path / "a", STACKS)
    done = scenefw("run=publish", "run.results=[a]", "paths.output=out")
    assert done.returncode == 0, done.stderr[-3000:]
    row = "| instance IoU ↑ | 0.822 | 0.610 | – |"
    assert row in document.read_text()
    done = scenefw("run=publish", "paths.output=out")
    assert done.returncode == 2
    assert "run.results" in done.stderr
