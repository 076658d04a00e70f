"""From data to a report: the data, a network trained on it, its figures beside published ones."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from scenefw.core.files import require_writable
from scenefw.core.measures import write_measures
from scenefw.core.protocols import Evaluation, Task
from scenefw.learning.runtime.measures import TRAINING
from scenefw.report.blocks import Drawing, Section, Text
from scenefw.report.console import track
from scenefw.report.figures import loss_figure, read_curves
from scenefw.report.protocols import Gallery, Presentation, ResultPage, Showcase
from scenefw.report.results import result_sections


class Pipeline:
    """Shows the data, trains, evaluates and reports (`run=pipeline`).

    Args:
        showcase: shows the data set.
        train: trains the network.
        losses: table that it leaves.
        evaluation: makes the evaluation, called after the training, as it may load its weights.
        presentation: how the result looks.
        gallery: shows examples; None: no examples.
        page: writes the report.
        output: the run's folder.
    """

    def __init__(
        self,
        showcase: Showcase,
        train: Task,
        losses: str | Path,
        evaluation: Callable[[], Evaluation],
        presentation: Presentation,
        gallery: Gallery | None,
        page: ResultPage,
        output: str | Path,
    ) -> None:
        self.showcase, self.train, self.losses = showcase, train, Path(losses)
        self.evaluation, self.presentation, self.gallery = evaluation, presentation, gallery
        self.page, self.output = page, Path(output)

    def run(self) -> dict[str, float]:
        """Returns the figures of all parts.

        Raises:
            StorageError: the folder can't be written.
            CheckpointError: weights that the evaluation compares are missing or damaged.
        """
        require_writable(self.output)
        print("1/4 data", flush=True)
        data, data_figures = self.showcase.show()
        print("2/4 training", flush=True)
        trained = dict(self.train.run())
        print("3/4 evaluation", flush=True)
        result = self.evaluation().run(track)
        print("4/4 report", flush=True)
        sections = result_sections(result, self.presentation, self.gallery, self.output)
        sections += [self._training(trained), *data]
        figures = {**result.figures, **data_figures, **trained}
        write_measures(self.output, {**result.measures, **TRAINING})
        print(self.page.write(self.output, sections, figures))
        return figures

    def _training(self, trained: Mapping[str, Any]) -> Section:
        words = (
            f"{trained.get('train/steps', 0):.0f} steps in {trained.get('train/seconds', 0):.0f} s "
            f"of a network of {trained.get('train/parameters', 0) / 1e6:.1f} million parameters."
        )
        curves = read_curves(self.losses)
        drawing = (Drawing(loss_figure(curves)),) if curves else ()
        return Section("Training", (Text(words), *drawing))
