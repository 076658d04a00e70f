"""What the result of an evaluation looks like on the page: tables, figures, pictures, words."""

from functools import singledispatch
from pathlib import Path
from typing import Any

from scenefw.evaluation.real_masks import RealMaskResult
from scenefw.evaluation.results import ReconstructionResult
from scenefw.report.blocks import Section
from scenefw.report.real_masks import real_mask_sections
from scenefw.report.reconstruction import reconstruction_sections
from scenefw.report.tables import Column, Table


@singledispatch
def sections(result: Any, folder: Path) -> tuple[Section, ...]:
    """The sections of a result, by its class; one that has `figures` alone gets a table of them.

    Args:
        result: of an evaluation.
        folder: of the page; pictures are written into it.
    """
    rows = tuple((name, (float(value),)) for name, value in result.figures.items())
    return (Section("Results", (Table("Figures", (Column("value", 4),), rows),)),)


@sections.register
def _(result: ReconstructionResult, folder: Path) -> tuple[Section, ...]:
    return reconstruction_sections(result)


@sections.register
def _(result: RealMaskResult, folder: Path) -> tuple[Section, ...]:
    return real_mask_sections(result, folder)
