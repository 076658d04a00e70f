"""Several evaluations in one run, for one page of results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from scenefw.core.errors import ConfigError
from scenefw.core.measures import join_measures

if TYPE_CHECKING:
    from scenefw.core.measures import Measure
    from scenefw.core.protocols import Evaluation, Result, Track


@dataclass(frozen=True)
class SeveralResults:
    """Results by name, in their order; each keeps its figures, as `<name>/<figure>`."""

    parts: Mapping[str, Result]

    @property
    def figures(self) -> dict[str, float]:
        """Figures of all parts."""
        return {
            f"{name}/{figure}": value
            for name, part in self.parts.items()
            for figure, value in part.figures.items()
        }

    @property
    def measures(self) -> dict[str, Measure]:
        """Units, digits and published values of the figures."""
        return join_measures((name, part.measures) for name, part in self.parts.items())


class Several:
    """Runs evaluations one after another.

    Args:
        parts: by name; None leaves one out.
    """

    def __init__(self, parts: Mapping[str, Evaluation | None]) -> None:
        self.parts = {name: part for name, part in parts.items() if part is not None}
        if not self.parts:
            raise ConfigError("nothing to evaluate; leave one of evaluation.parts in")

    def run(self, track: Track = lambda items, _: items) -> SeveralResults:
        """The results of all; `track` wraps the loops of each in a progress bar."""
        return SeveralResults({name: part.run(track) for name, part in self.parts.items()})
