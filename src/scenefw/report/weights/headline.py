"""The README's table: our figures beside those without learning and published ones."""

from collections.abc import Sequence

from scenefw.core.errors import InputError
from scenefw.report.stored import StoredRun
from scenefw.report.tables import Cell, Table, to_markdown
from scenefw.report.weights.measures import (
    COLUMNS,
    IMAGES,
    LABELLING,
    STACKS,
    Group,
    figures_of,
    groups_in,
)

GROUPS = (STACKS, IMAGES, LABELLING)


def headline(runs: Sequence[StoredRun]) -> str:
    """One table of all runs in Markdown, and the commands that found its figures.

    Args:
        runs: of stacks, real images and labelling, as many as there are, one of each at most.

    Raises:
        InputError: there is none, one has other figures, or two have the same.
    """
    if not runs:
        raise InputError("no results to show; give run.results=[FOLDER,...] of run=evaluate")
    by_group: dict[Group, StoredRun] = {}
    for run in runs:
        for group in groups_in(run, GROUPS):
            if group in by_group:
                raise InputError(f"{by_group[group].path} and {run.path} hold the same figures")
            by_group[group] = run
    rows: list[tuple[str, tuple[Cell, ...]]] = []
    shown = [group for group in GROUPS if group in by_group]
    for group in shown:
        figures = figures_of(by_group[group])
        rows.append((f"**{group.title.format_map(figures)}**", ("",) * len(COLUMNS)))
        rows += group.rows(figures, brief=True)
    table = Table("Figures of the weights that ship", COLUMNS, tuple(rows))
    commands = dict.fromkeys(by_group[group].origin for group in shown)
    return "\n".join(
        [to_markdown(table), *[f"*{g.name}.* {g.note}\n" for g in shown], "```", *commands, "```"]
    )
