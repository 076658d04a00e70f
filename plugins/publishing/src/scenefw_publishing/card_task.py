"""Writes the card of a file of weights."""

from collections.abc import Sequence
from pathlib import Path

from scenefw import registry
from scenefw.core.errors import ConfigError
from scenefw.core.files import require_writable
from scenefw.learning.checkpoint import weights_file
from scenefw.learning.provenance import Provenance, read_provenance
from scenefw.report.page import Page
from scenefw.report.publication import publish
from scenefw.report.record import read_record
from scenefw_publishing.cards import card_sections
from scenefw_publishing.stored import read_runs
from scenefw_publishing.words import Words


class Card:
    """A model card: what the weights are, how they were made, their figures (`run=card`).

    Writes `<name>.md` and a page into the run's folder.

    Args:
        checkpoint: file of weights, or the name of weights that come with scenefw or a plugin; None
            means those named `shipped`.
        output: the run's folder.
        publish: also write the card to this file, e.g. beside the weights; None = don't.
        results: folders of evaluations of these weights.
        before: weights of earlier trainings that the file does not know of, the last one first.
        notes: further limits, one line each.
        shipped: name of the weights that are meant if none are given.
        words: texts of the card; None takes those of group `card` for the network's task and input.
    """

    def __init__(
        self,
        checkpoint: str | Path | None,
        output: str | Path,
        publish: str | Path | None = None,
        results: Sequence[str | Path] = (),
        before: Sequence[str | Path] = (),
        notes: Sequence[str] = (),
        shipped: str = "simstack",
        words: Words | None = None,
    ) -> None:
        self.checkpoint, self.output, self.publish = checkpoint, Path(output), publish
        self.results, self.before, self.notes = list(results), list(before), list(notes)
        self.shipped, self.words = shipped, words

    def run(self) -> dict[str, float]:
        """Writes the card; returns size and length of training.

        Raises:
            CheckpointError: weights are missing, damaged or from elsewhere.
            ConfigError: several options of group `card` are for such a network.
            InputError: results are missing, damaged, or of other weights.
            StorageError: the folder can't be written.
        """
        require_writable(self.output)
        provenance = read_provenance(weights_file(self.checkpoint, self.shipped))
        before = [t for path in self.before for t in read_provenance(path).trainings]
        words = self.words or words_for(provenance)
        sections = card_sections(provenance, words, read_runs(self.results), before, self.notes)
        name = provenance.path.stem
        title = f"Weights {name}"
        card = publish(
            self.output / f"{name}.md", title, sections, self.output, read_record(self.output)
        )
        trainings = [*provenance.trainings, *before]
        figures = {
            "numbers": float(provenance.numbers),
            "trainings": float(len(trainings)),
            "steps": float(sum(t.get("steps", 0) for t in trainings)),
            "samples": float(sum(t.get("samples", 0) for t in trainings)),
        }
        Page(title, self.publish).write(self.output, sections, figures)
        print(self.publish or card)
        return figures


def words_for(provenance: Provenance) -> Words | None:
    """Texts for a network by task, input and class, of plugins too; None if there are none.

    Texts that say more of what they are for go before those that say less.

    Raises:
        ConfigError: there are several.
    """
    facts = {
        "input": provenance.metadata.get("input"),
        "network": str(provenance.recipe["_target_"]).rpartition(".")[2],
    }
    fitting: dict[int, list[str]] = {}
    for name, path in registry.options("card").items():
        settings = registry.settings(path)
        conditions = {key: settings[key] for key in facts if settings.get(key) is not None}
        if settings.get("task") == provenance.task and conditions.items() <= facts.items():
            fitting.setdefault(len(conditions), []).append(name)
    if not fitting:
        return None
    names = fitting[max(fitting)]
    if len(names) > 1:
        raise ConfigError(
            f"{' and '.join(names)} are cards for {provenance.task}; choose one, card={names[0]}"
        )
    words: Words = registry.build("card", names[0])
    return words
