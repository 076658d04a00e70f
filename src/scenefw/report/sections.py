"""What the result of an evaluation looks like on the page: tables, figures, pictures, words."""

from functools import singledispatch
from pathlib import Path
from typing import Any

from scenefw.evaluation.gathered_runs import RunsResult
from scenefw.evaluation.labelling.curves import CurvesResult
from scenefw.evaluation.labelling.networks import NetworksResult
from scenefw.evaluation.labelling.noise import NoiseResult
from scenefw.evaluation.labelling.pool_weights import WeightsResult
from scenefw.evaluation.labelling.times import TimesResult
from scenefw.evaluation.several import SeveralResults
from scenefw.evaluation.stacks.real_masks import RealMaskResult
from scenefw.evaluation.stacks.results import ReconstructionResult
from scenefw.report.blocks import Section
from scenefw.report.labelling.sections import (
    curves_sections,
    network_sections,
    noise_sections,
    times_sections,
    weights_sections,
)
from scenefw.report.runs import runs_sections
from scenefw.report.stacks.real_masks import real_mask_sections
from scenefw.report.stacks.reconstruction import reconstruction_sections
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
def _(result: RunsResult, folder: Path) -> tuple[Section, ...]:
    return runs_sections(result)


@sections.register
def _(result: RealMaskResult, folder: Path) -> tuple[Section, ...]:
    return real_mask_sections(result, folder)


@sections.register
def _(result: CurvesResult, folder: Path) -> tuple[Section, ...]:
    return curves_sections(result, folder)


@sections.register
def _(result: NoiseResult, folder: Path) -> tuple[Section, ...]:
    return noise_sections(result, folder)


@sections.register
def _(result: NetworksResult, folder: Path) -> tuple[Section, ...]:
    return network_sections(result)


@sections.register
def _(result: TimesResult, folder: Path) -> tuple[Section, ...]:
    return times_sections(result)


@sections.register
def _(result: WeightsResult, folder: Path) -> tuple[Section, ...]:
    return weights_sections(result)


@sections.register
def _(result: SeveralResults, folder: Path) -> tuple[Section, ...]:
    return tuple(section for part in result.parts.values() for section in sections(part, folder))
