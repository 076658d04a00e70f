import hashlib
import json

import pytest
from tests.unit.learning import tiny
from tests.unit.report.stored_runs import IMAGES, LABELLING, write_run

from scenefw.core.types import GridSpec
from scenefw.learning.checkpoint import save_checkpoint, shipped_checkpoint
from scenefw.learning.provenance import read_provenance
from scenefw_publishing.card_task import Card


def test_the_card_in_the_run_folder_and_where_it_is_published(tmp_path):
    results = write_run(tmp_path / "osd", IMAGES)
    target = tmp_path / "docs" / "simstack.md"
    figures = Card("simstack", tmp_path / "out", target, [results], notes=["A note."]).run()
    text = target.read_text()
    assert text == (tmp_path / "out" / "simstack.md").read_text()
    assert text.startswith("# Weights simstack")
    for words in ("## Intended use", "- A note.", "| overlap F (%) ↑ | 90.6 |", "Apache-2.0"):
        assert words in text
    assert figures["steps"] > 0
    assert (tmp_path / "out" / "report.html").exists()


@pytest.mark.parametrize("path", sorted(shipped_checkpoint().parent.glob("*.safetensors")))
def test_shipped_weights_have_their_card_beside_them(path):
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    again = f"run=card checkpoint={path.stem} report.publish=... (CONTRIBUTING.md)"
    assert digest in path.with_suffix(".md").read_text(), f"make the card anew: {again}"


def test_command_line(scenefw, tmp_path):
    write_run(tmp_path / "labels", LABELLING)
    words = ("run=card", "checkpoint=label_views", "paths.output=out")
    done = scenefw(*words, "run.results=[labels]", "report.publish=card.md")
    assert done.returncode == 0, done.stderr[-3000:]
    assert (
        "run=card checkpoint=label_views 'run.results=[labels]'"
        in (tmp_path / "card.md").read_text()
    )
    figures = json.loads((tmp_path / "out" / "metrics.json").read_text())
    known = read_provenance(shipped_checkpoint("label_views")).trainings
    assert figures["trainings"] == len(known) > 1
    assert figures["steps"] == sum(training["steps"] for training in known)
    for wrong in ("[none]", "[out]"):  # missing, and without figures of a network
        done = scenefw(*words, f"run.results={wrong}")
        assert done.returncode == 2
        assert len(done.stderr.strip().splitlines()) == 1, done.stderr


CARD = """\
# Card of a network of sounds
_target_: scenefw_publishing.words.Words
task: hearing
input: {sees}
what: Hears things.
use: [To listen.]
limits: [It is deaf to whispers.]
licence: Free.
"""


def write_plugin(folder, *cards):
    """A plugin with weights in its package and cards."""
    package, conf = folder / "src" / "scenefw_ears", folder / "conf" / "card"
    for path in (package / "assets", conf):
        path.mkdir(parents=True)
    (package / "__init__.py").write_text("")
    model = tiny.network()
    path = package / "assets" / "ears.safetensors"
    save_checkpoint(path, model, model.recipe, GridSpec(8), {"input": "sound"}, task="hearing")
    for number, sees in enumerate(cards):
        (conf / f"ears{number}.yaml").write_text(CARD.format(sees=sees))
    project = '[project.entry-points."scenefw.plugins"]\nears = "scenefw_ears"\n'
    (folder / "pyproject.toml").write_text(project)


@pytest.mark.parametrize(
    ("cards", "expected"),
    [
        (["sound"], "Hears things."),
        (["null"], "Hears things."),
        (["null", "sound"], "Hears things."),
        (["light"], "conf/card/NAME.yaml with task: hearing and input: sound"),
        ([], "conf/card/NAME.yaml with task: hearing and input: sound"),
    ],
)
def test_weights_of_a_plugin_and_their_card(scenefw, tmp_path, cards, expected):
    write_plugin(tmp_path / "plugins" / "ears", *cards)
    done = scenefw("run=card", "checkpoint=ears", "paths.output=out")
    assert done.returncode == 0, done.stderr[-3000:]
    assert expected in (tmp_path / "out" / "ears.md").read_text()


def test_without_a_checkpoint_the_card_is_of_the_weights_of_the_experiment(scenefw, tmp_path):
    write_plugin(tmp_path / "plugins" / "ears", "sound")
    experiment = tmp_path / "plugins" / "ears" / "conf" / "experiment" / "listening.yaml"
    experiment.parent.mkdir()
    experiment.write_text("# @package _global_\n# Listens to sounds\npaths:\n  weights: ears\n")
    done = scenefw("experiment=listening", "run=card", "paths.output=out")
    assert done.returncode == 0, done.stderr[-3000:]
    assert (tmp_path / "out" / "ears.md").exists()


def test_of_two_cards_one_has_to_be_chosen(scenefw, tmp_path):
    write_plugin(tmp_path / "plugins" / "ears", "sound", "sound")
    words = ("run=card", "checkpoint=ears", "paths.output=out")
    done = scenefw(*words)
    assert done.returncode == 2
    assert "card=ears0" in done.stderr
    done = scenefw(*words, "card=ears1")
    assert done.returncode == 0, done.stderr[-3000:]
