"""Sections of a decomposition into sets: figures, codes, test scenes."""

from pathlib import Path

from scenefw.evaluation.sets.results import DecompositionResult
from scenefw.report.blocks import Section
from scenefw.report.presentation import Show
from scenefw.report.sets.codes import code_blocks
from scenefw.report.sets.examples import example_pictures
from scenefw.report.sets.tables import decomposition_tables

_TITLES = {"of_six": "6 objects", "of_four_to_eight": "4 to 8 objects", "from_view": "One view"}


def decomposition_sections(result: DecompositionResult, folder: Path) -> tuple[Section, ...]:
    """Figures beside the thesis's, codes and scenes of a decomposition."""
    name = _TITLES.get(result.published or "", "Scenes as sets")
    codes = code_blocks(result)
    sections = [Section(f"{name}: decomposition", decomposition_tables(result))]
    if codes:
        sections.append(Section(f"{name}: codes", codes))
    pictures = example_pictures(result, folder)
    if pictures:
        sections.append(Section(f"{name}: test scenes", pictures))
    return tuple(sections)


SECTIONS: dict[type, Show] = {DecompositionResult: decomposition_sections}
