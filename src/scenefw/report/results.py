"""Sections of a result with examples among them."""

from pathlib import Path

from scenefw.core.protocols import Result
from scenefw.report.blocks import Section
from scenefw.report.console import print_tables
from scenefw.report.protocols import Gallery, Presentation
from scenefw.report.tables import Table

EXAMPLES = "Predictions beside ground truth"


def result_sections(
    result: Result, presentation: Presentation, gallery: Gallery | None, folder: Path
) -> list[Section]:
    """Prints the first tables of a result; its sections, examples second if there are any.

    Args:
        result: of an evaluation.
        presentation: makes the sections.
        gallery: makes the examples; None: there are none.
        folder: of the page.

    Raises:
        StorageError: the folder can't be written.
    """
    sections = list(presentation.sections(result, folder))
    with_tables = [s for s in sections if any(isinstance(block, Table) for block in s.blocks)]
    print_tables(with_tables[:1])
    if with_tables[1:]:
        print(f"more tables: {', '.join(section.title for section in with_tables[1:])}")
    examples = () if gallery is None else tuple(gallery.show())
    return [*sections[:1], *([Section(EXAMPLES, examples)] if examples else []), *sections[1:]]
