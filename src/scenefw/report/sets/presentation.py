"""Presentation of this chapter's results."""

from pathlib import Path

from scenefw.core.protocols import Result
from scenefw.evaluation.sets.prior_results import PriorResult
from scenefw.evaluation.sets.results import DecompositionResult
from scenefw.report.blocks import Section
from scenefw.report.presentation import Show, sections_by_class
from scenefw.report.sets.codes import code_blocks
from scenefw.report.sets.examples import example_pictures
from scenefw.report.sets.prior import prior_sections
from scenefw.report.sets.tables import decomposition_tables

_TITLES = {"of_six": "6 objects", "of_four_to_eight": "4 to 8 objects", "from_view": "One view"}


class SetResults:
    """Decompositions beside the thesis's, codes, and scenes (group `presentation`)."""

    def sections(self, result: Result, folder: Path) -> tuple[Section, ...]:
        """Sections of the chapter's results; other results get a table of their figures."""
        shown_by: dict[type, Show] = {DecompositionResult: _sections, PriorResult: prior_sections}
        return sections_by_class(result, folder, shown_by)


def _sections(result: DecompositionResult, folder: Path) -> tuple[Section, ...]:
    name = _TITLES.get(result.published or "", "Scenes as sets")
    codes = code_blocks(result)
    sections = [Section(f"{name}: decomposition", decomposition_tables(result))]
    if codes:
        sections.append(Section(f"{name}: codes", codes))
    pictures = example_pictures(result, folder)
    if pictures:
        sections.append(Section(f"{name}: test scenes", pictures))
    return tuple(sections)
