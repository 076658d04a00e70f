"""Writes what a document shows of the weights that ship."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from scenefw.core.errors import ConfigError
from scenefw_publishing.headline import Headline
from scenefw_publishing.pictures import Pictures
from scenefw_publishing.summary import Summary


class Publish:
    """Puts figures of runs, pictures of real images or both into a document (`run=publish`).

    Args:
        results: folders of evaluations, for the table; none = it stays.
        summaries: of kinds of evaluations, by name, in the order of the table; None leaves one out.
        pictures: makes what draws the pictures.
        input: folder of their images; None = they stay.
        document: that shows them, e.g. README.md.

    Raises:
        ConfigError: there is nothing to publish.
    """

    def __init__(
        self,
        results: Sequence[str | Path],
        summaries: Mapping[str, Summary | None],
        pictures: Callable[[], Pictures],
        input: str | Path | None = None,  # noqa: A002 - the setting's name
        document: str | Path = "README.md",
    ) -> None:
        if not results and input is None:
            raise ConfigError(
                "nothing to publish; give run.results=[FOLDER,...] of run=evaluate for the table, "
                "input=FOLDER of real images for the pictures"
            )
        self.results, self.input, self.pictures = list(results), input, pictures
        self.headline = Headline(results, summaries, document)

    def run(self) -> dict[str, float]:
        """Writes the table, then the pictures; returns how many runs and objects they show.

        Raises:
            InputError: a run or an image is missing or unusable, or figures aren't of what ships.
            StorageError: the document has no place for them, or something can't be written.
        """
        figures = self.headline.run() if self.results else {}
        return figures if self.input is None else figures | self.pictures().run()
