"""The text of a card for one kind of network."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from scenefw_publishing.summary import Summary


@dataclass(frozen=True)
class Words:
    """Texts of a card, and the figures that sum up such a network (group `card`).

    Args:
        task: what the network is for, as files of weights have it.
        input: what it sees, as their metadata have it; None = anything.
        network: its class, such as SetFlow; None = any.
        what: from what to what.
        use: what it is for, a point each.
        limits: where it ends, a point each.
        licence: of code and weights.
        figures: summaries of its evaluations, by name; None leaves one out.
    """

    task: str
    what: str
    use: Sequence[str]
    limits: Sequence[str]
    licence: str
    input: str | None = None
    network: str | None = None
    figures: Mapping[str, Summary | None] = field(default_factory=dict)

    @property
    def summaries(self) -> tuple[Summary, ...]:
        """The remaining ones."""
        return tuple(summary for summary in self.figures.values() if summary is not None)
