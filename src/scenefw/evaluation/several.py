"""Several evaluations in one run, for one page of results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from scenefw.core.errors import ConfigError


class Evaluation(Protocol):
    """One of them."""

    def run(self, track: Any = ...) -> Any:
        """Its result, with `figures` by name."""


@dataclass(frozen=True)
class SeveralResults:
    """Results by name, in their order."""

    parts: Mapping[str, Any]

    @property
    def figures(self) -> dict[str, float]:
        """Figures of all, as `<name>/<figure>`."""
        return {
            f"{name}/{figure}": value
            for name, part in self.parts.items()
            for figure, value in part.figures.items()
        }


class Several:
    """Runs evaluations one after another.

    Args:
        parts: by name; None leaves one out.
    """

    def __init__(self, parts: Mapping[str, Evaluation | None]) -> None:
        self.parts = {name: part for name, part in parts.items() if part is not None}
        if not self.parts:
            raise ConfigError("nothing to evaluate; leave one of evaluation.parts in")

    def run(self, track: Any = lambda items, _: items) -> SeveralResults:
        """The results of all; `track` wraps the loops of each in a progress bar."""
        return SeveralResults({name: part.run(track) for name, part in self.parts.items()})
