"""Evaluates methods and shows how they do."""

from pathlib import Path
from typing import Any, Protocol

from scenefw.core.files import require_writable
from scenefw.report.blocks import Section
from scenefw.report.console import print_tables, track
from scenefw.report.page import Page
from scenefw.report.sections import sections
from scenefw.report.stacks.gallery import Gallery


class Evaluation(Protocol):
    """A protocol that scores methods (group `evaluation`)."""

    def run(self, track: Any = ...) -> Any:
        """The result, with `figures` by name; `track(items, what)` shows a bar of a loop."""


class Evaluate:
    """Runs an evaluation, prints its tables and writes the report.

    Args:
        evaluation: what to run.
        page: writes the report.
        output: the run's folder.
        gallery: shows examples; None = no gallery.
    """

    def __init__(
        self,
        evaluation: Evaluation,
        page: Page,
        output: str | Path,
        gallery: Gallery | None = None,
    ) -> None:
        self.evaluation = evaluation
        self.page = page
        self.output = Path(output)
        self.gallery = gallery

    def run(self) -> dict[str, float]:
        """Returns the figures of the evaluation.

        Raises:
            StorageError: the folder can't be written.
        """
        require_writable(self.output)
        result = self.evaluation.run(track)
        shown = list(sections(result, self.output))
        print_tables(shown)
        if self.gallery is not None:
            shown.insert(1, Section("Predictions beside ground truth", self.gallery.show()))
        figures = dict(result.figures)
        print(self.page.write(self.output, shown, figures))
        return figures
