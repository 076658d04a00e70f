"""Presentation of this chapter's results."""

from pathlib import Path

from scenefw.core.protocols import Result
from scenefw.evaluation.labelling.curves import CurvesResult
from scenefw.evaluation.labelling.networks import NetworksResult
from scenefw.evaluation.labelling.noise import NoiseResult
from scenefw.evaluation.labelling.pool_weights import WeightsResult
from scenefw.evaluation.labelling.times import TimesResult
from scenefw.report.blocks import Section
from scenefw.report.labelling.sections import (
    curves_sections,
    network_sections,
    noise_sections,
    times_sections,
    weights_sections,
)
from scenefw.report.presentation import Show, sections_by_class

_SHOWN_BY: dict[type, Show] = {
    CurvesResult: curves_sections,
    NoiseResult: noise_sections,
    NetworksResult: lambda result, _: network_sections(result),
    TimesResult: lambda result, _: times_sections(result),
    WeightsResult: lambda result, _: weights_sections(result),
}


class LabellingResults:
    """Curves, noise maps, networks, times and weights of the pool."""

    def sections(self, result: Result, folder: Path) -> tuple[Section, ...]:
        """Sections of the chapter's results; other results get a table of their figures."""
        return sections_by_class(result, folder, _SHOWN_BY)
