"""The whole of it: stacks, a network trained for some minutes, figures beside others', a report."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from scenefw.core.files import require_writable
from scenefw.core.protocols import Reconstructor, Task
from scenefw.learning.checkpoint import load_checkpoint
from scenefw.report.blocks import Drawing, Section, Text
from scenefw.report.console import print_tables, track
from scenefw.report.figures import loss_figure, read_curves
from scenefw.report.page import Page
from scenefw.report.sections import sections
from scenefw.report.stacks.dataset import Stacks
from scenefw.report.stacks.gallery import Gallery
from scenefw.tasks.evaluate import Evaluation

TRAINED_HERE = "trained_here"


class Pipeline:
    """Shows the stacks, trains, evaluates and reports.

    The network trained here is compared, on the same views, with the checkpoint (the shipped one or
    `checkpoint=...`) and with references that need no learning.

    Args:
        stacks: shows the data set.
        train: trains the network.
        weights: file that it leaves.
        losses: table that it leaves.
        network: from a `checkpoint` to a method.
        evaluation: from methods by name to an evaluation of them.
        methods: what the trained network is compared with; the first is the main one.
        gallery: shows examples.
        page: writes the report.
        output: the run's folder.
    """

    def __init__(
        self,
        stacks: Stacks,
        train: Task,
        weights: str | Path,
        losses: str | Path,
        network: Callable[..., Reconstructor],
        evaluation: Callable[..., Evaluation],
        methods: Mapping[str, Reconstructor],
        gallery: Gallery,
        page: Page,
        output: str | Path,
    ) -> None:
        self.stacks = stacks
        self.train = train
        self.weights = Path(weights)
        self.losses = Path(losses)
        self.network = network
        self.evaluation = evaluation
        self.methods = dict(methods)
        self.gallery = gallery
        self.page = page
        self.output = Path(output)

    def run(self) -> dict[str, float]:
        """Returns the figures of all parts.

        Raises:
            StorageError: the folder can't be written.
            CheckpointError: the checkpoint to compare with is missing or damaged.
        """
        require_writable(self.output)
        print("1/4 stacks", flush=True)
        stacks, figures = self.stacks.show()
        print("2/4 training", flush=True)
        trained = dict(self.train.run())
        print("3/4 evaluation", flush=True)
        result = self.evaluation(methods=self._with_trained()).run(track)
        found = sections(result, self.output)
        print_tables(found)
        print("4/4 report", flush=True)
        figures = {**result.figures, **figures, **trained}
        main, *others = found
        examples = Section("Predictions beside ground truth", self.gallery.show())
        shown = [main, examples, *others, self._losses(trained), stacks]
        print(self.page.write(self.output, shown, figures))
        return figures

    def _with_trained(self) -> dict[str, Reconstructor]:
        """The methods, the network trained here in second place."""
        (name, main), *others = self.methods.items()
        mine = self.network(checkpoint=load_checkpoint(self.weights))
        return {name: main, TRAINED_HERE: mine, **dict(others)}

    def _losses(self, trained: Mapping[str, Any]) -> Section:
        words = (
            f"{trained.get('train/steps', 0):.0f} steps in {trained.get('train/seconds', 0):.0f} s "
            f"of a network of {trained.get('train/parameters', 0) / 1e6:.1f} million parameters."
        )
        curves = read_curves(self.losses)
        drawing = (Drawing(loss_figure(curves)),) if curves else ()
        return Section("Training", (Text(words), *drawing))
