"""Evaluates methods and shows the results."""

from pathlib import Path

from scenefw.core.files import require_writable
from scenefw.core.measures import write_measures
from scenefw.core.protocols import Evaluation
from scenefw.report.console import track
from scenefw.report.protocols import Gallery, Presentation, ResultPage
from scenefw.report.results import result_sections


class Evaluate:
    """Runs an evaluation, prints its tables and writes the report (`run=evaluate`).

    Args:
        evaluation: what to run.
        presentation: how its result looks.
        gallery: shows examples; None: no examples.
        page: writes the report.
        output: the run's folder.
    """

    def __init__(
        self,
        evaluation: Evaluation,
        presentation: Presentation,
        gallery: Gallery | None,
        page: ResultPage,
        output: str | Path,
    ) -> None:
        self.evaluation, self.presentation, self.gallery = evaluation, presentation, gallery
        self.page, self.output = page, Path(output)

    def run(self) -> dict[str, float]:
        """Returns the figures of the evaluation; `measures.json` says what they measure.

        Raises:
            StorageError: the folder can't be written.
        """
        require_writable(self.output)
        result = self.evaluation.run(track)
        sections = result_sections(result, self.presentation, self.gallery, self.output)
        figures = dict(result.figures)
        write_measures(self.output, result.measures)
        print(self.page.write(self.output, sections, figures))
        return figures
