"""Trains and evaluates a network in one run, for comparisons of many settings."""

from collections.abc import Callable
from pathlib import Path

from scenefw.core.errors import ConfigError
from scenefw.core.files import require_writable
from scenefw.core.measures import write_measures
from scenefw.core.protocols import Evaluation, Task
from scenefw.learning.runtime.measures import TRAINING
from scenefw.report.console import track
from scenefw.report.protocols import Gallery, Presentation, ResultPage
from scenefw.report.results import result_sections


class TrainAndEvaluate:
    """Trains a network, then runs any evaluation of it (`run=train_and_evaluate`).

    Args:
        train: trains the network.
        evaluation: makes the evaluation, called after the training, as it loads its weights.
        presentation: how the result looks.
        gallery: shows examples; made after the training too.
        page: writes the report.
        output: the run's folder.
        weights: file that the training leaves.
        checkpoint: file that the evaluation reads.

    Raises:
        ConfigError: the evaluation would read other weights.
    """

    def __init__(
        self,
        train: Task,
        evaluation: Callable[[], Evaluation],
        presentation: Presentation,
        gallery: Callable[[], Gallery | None],
        page: ResultPage,
        output: str | Path,
        weights: str | Path,
        checkpoint: str | Path | None,
    ) -> None:
        if str(weights) != str(checkpoint):
            raise ConfigError(
                f"run=train_and_evaluate evaluates what it trains, not {checkpoint}; leave "
                "checkpoint=... out, or start from it with learning.initial=..."
            )
        self.train, self.evaluation = train, evaluation
        self.presentation, self.gallery = presentation, gallery
        self.page, self.output = page, Path(output)

    def run(self) -> dict[str, float]:
        """Returns the figures of the training and of the evaluation.

        Raises:
            StorageError: the folder can't be written.
        """
        require_writable(self.output)
        trained = dict(self.train.run())
        result = self.evaluation().run(track)
        sections = result_sections(result, self.presentation, self.gallery(), self.output)
        figures = {**trained, **result.figures}
        write_measures(self.output, {**TRAINING, **result.measures})
        print(self.page.write(self.output, sections, figures))
        return figures
