"""Writes the table of a document that says how well the shipped weights do."""

from collections.abc import Sequence
from pathlib import Path

from scenefw.report.headline import headline
from scenefw.report.markers import fill, read
from scenefw.report.stored import read_runs

_MARKER = "headline"


class Headline:
    """Puts figures of runs between `<!-- headline -->` and `<!-- /headline -->` (`run=headline`).

    Args:
        results: folders of evaluations, of stacks, real images and labelling, in any order.
        document: that shows them, e.g. README.md.
    """

    def __init__(self, results: Sequence[str | Path], document: str | Path = "README.md") -> None:
        self.results, self.document = list(results), Path(document)

    def run(self) -> dict[str, float]:
        """Writes the table; returns how many runs it shows.

        Raises:
            InputError: a run is missing, damaged, or has no figures for it.
            StorageError: the document has no place for it, or can't be written.
        """
        read(self.document, _MARKER)
        runs = read_runs(self.results)
        text = headline(runs)
        fill(self.document, _MARKER, text)
        print(text)
        return {"runs": float(len(runs))}
