"""What rankings put first, as a table."""

from __future__ import annotations

from scenefw.report import measured
from scenefw.report.blocks import Section
from scenefw.report.presentation import Show
from scenefw.report.stacks.draws import ranged
from scenefw.report.tables import Cell, Column, Table
from scenefw_single_view_benchmarks.ranking_results import ANY, BEST, FIRST, SCORES, RankingResult

_NAMES = {
    FIRST: "the first hypothesis, which stays the first",
    ANY: "any draw (order by chance)",
    BEST: "the best draw, chosen with the truth",
}


def ranking_sections(result: RankingResult) -> tuple[Section, ...]:
    """A row for what each ranking puts first, with gains over any draw."""
    columns: list[Column] = []
    for score in SCORES.values():
        columns += [measured.column(score), Column("gain, 95 %")]
    rows = []
    for row in result.rows:
        cells: list[Cell] = []
        for name, measure in SCORES.items():
            gain = "–" if row == ANY else ranged(result.gain(row, name), measure)
            cells += [measure.shown(result.score(row, name).mean), gain]
        rows.append((_NAMES.get(row, f"first by {row.replace('_', ' ')}"), tuple(cells)))
    note = (
        f"{len(result.views)} views of as many scenes, {result.draws} draws each. Displacement: of "
        "objects that are left to gravity, on average, 20 cm each at most. Gain: beyond any draw "
        "of the same views, 95 % bounds of the mean difference. A ranking orders draws alone; the "
        "best draw is the one with the best instance IoU."
    )
    quoted = frozenset({_NAMES[BEST]})
    table = Table("The draw that comes first", tuple(columns), tuple(rows), quoted, note)
    return (Section("Rankings", (table,)),)


SECTIONS: dict[type, Show] = {RankingResult: lambda result, _: ranking_sections(result)}
