"""Examples on the page: the distributions of some test views."""

from scenefw.report.tables import Column, Table
from scenefw_object_count.evaluation import CountEvaluation


class CountExamples:
    """A row per view: the true number, and the probability of each (setting `gallery`).

    Args:
        evaluation: makes the views; its main method counts.
        count: views shown, one of each of the first scenes.
    """

    def __init__(self, evaluation: CountEvaluation, count: int = 8) -> None:
        self.evaluation, self.count = evaluation, count

    def show(self) -> tuple[Table, ...]:
        """The table."""
        scenes = range(min(self.count, len(self.evaluation.scenes)))
        views = [self.evaluation.look(scene, 0) for scene in scenes]
        main = next(iter(self.evaluation.methods))
        rows = tuple(
            (f"scene {v.scene}", (str(v.count), *(f"{p:.2f}" for p in v.probabilities[main])))
            for v in views
        )
        numbers = range(len(views[0].probabilities[main]))
        columns = (Column("true number"), *(Column(f"p({i + 1})") for i in numbers))
        note = "One view of each scene; the rows of a perfect count are 1 at the true number."
        return (Table("What the network says of single views", columns, rows, note=note),)
