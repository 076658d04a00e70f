"""Protocols of what a page shows: results, examples, data."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from scenefw.core.protocols import Result
from scenefw.report.blocks import Block, Section


class Presentation(Protocol):
    """How the result of an evaluation looks (group `presentation`)."""

    def sections(self, result: Result, folder: Path) -> Sequence[Section]:
        """The sections of a result; pictures are written into the folder, that of the page."""


class Gallery(Protocol):
    """Examples of what methods make of single scenes (setting `gallery`)."""

    def show(self) -> Sequence[Block]:
        """The blocks below the heading of the examples; empty = no such section."""


class Showcase(Protocol):
    """What a page shows of the data that a network learns from (group `showcase`)."""

    def show(self) -> tuple[Sequence[Section], Mapping[str, float]]:
        """Sections, and figures of the data by name."""


class ResultPage(Protocol):
    """Where the results of a run are shown (group `report`)."""

    def write(self, folder: Path, sections: Sequence[Section], figures: Mapping[str, Any]) -> Path:
        """Writes them and returns the file.

        Args:
            folder: the run's; pictures that sections name lie in it.
            sections: in their order.
            figures: flat figures, as in `metrics.json`.

        Raises:
            StorageError: the folder can't be written.
        """
