"""A network trained and scored in one run, as comparisons of many settings need it."""

from collections.abc import Callable, Mapping
from pathlib import Path

from scenefw.core.files import require_writable
from scenefw.core.protocols import Reconstructor, Task
from scenefw.evaluation.several import Several
from scenefw.learning.checkpoint import load_checkpoint
from scenefw.report.console import print_tables, track
from scenefw.report.page import Page
from scenefw.report.sections import sections
from scenefw.tasks.evaluate import Evaluation


class TrainAndEvaluate:
    """Trains a network, then scores it alone on several sets of views (`run=train_and_evaluate`).

    Args:
        train: trains the network.
        weights: file that it leaves.
        network: from a `checkpoint` to a method.
        evaluations: by name, from methods by name to an evaluation of them.
        page: writes the report.
        output: the run's folder.
    """

    def __init__(
        self,
        train: Task,
        weights: str | Path,
        network: Callable[..., Reconstructor],
        evaluations: Mapping[str, Callable[..., Evaluation]],
        page: Page,
        output: str | Path,
    ) -> None:
        self.train, self.weights = train, Path(weights)
        self.network, self.evaluations = network, dict(evaluations)
        self.page, self.output = page, Path(output)

    def run(self) -> dict[str, float]:
        """Returns the figures of the training, and those of the evaluations as `<name>/<figure>`.

        Raises:
            StorageError: the folder can't be written.
        """
        require_writable(self.output)
        trained = dict(self.train.run())
        methods = {"scenefw": self.network(checkpoint=load_checkpoint(self.weights))}
        parts = {name: make(methods=methods) for name, make in self.evaluations.items()}
        result = Several(parts).run(track)
        shown = sections(result, self.output)
        print_tables(shown)
        figures = {**trained, **result.figures}
        print(self.page.write(self.output, list(shown), figures))
        return figures
