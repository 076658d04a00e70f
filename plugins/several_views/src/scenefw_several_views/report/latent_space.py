"""Variety of draws against the number of views, and ways between codes, as tables and curves."""

from __future__ import annotations

from scenefw.core.measures import Measure
from scenefw.report import measured
from scenefw.report.blocks import Drawing, Section
from scenefw.report.figures import bin_figure
from scenefw.report.presentation import Show
from scenefw.report.stacks.draws import ranged
from scenefw.report.tables import Cell, Column, Table
from scenefw_several_views.latent_space_results import (
    BLENDED,
    CODES,
    VARIETY,
    WAYS,
    LatentSpaceResult,
)

_CURVES = {
    "Shapes, 1 - IoU": {
        "draws apart": "among",
        "draws from the truth": "to_truth",
        "zero code from the truth": "zero_to_truth",
    },
    "Instances, 1 - IoU": {
        "draws apart": "instances_among",
        "draws from the truth": "instances_to_truth",
    },
}
_RATIO = Measure("variety by error", digits=2)
_KINDS = {CODES: "through codes", BLENDED: "mean of both volumes (no learning)"}
_RANGED = ("among", "to_truth")


def latent_space_sections(result: LatentSpaceResult) -> tuple[Section, ...]:
    """Figure 5.38 in numbers, and how smooth ways between codes are (figs 5.39, 5.40)."""
    edges = [result.counts[0] - 0.5, *(count + 0.5 for count in result.counts)]
    panels = {
        title: {
            words: [result.variety(count, name).mean for count in result.counts]
            for words, name in lines.items()
        }
        for title, lines in _CURVES.items()
    }
    return (
        Section(
            "Variety by the number of views",
            (Drawing(bin_figure(edges, panels, "views")), variety_table(result)),
        ),
        Section("From one code to another", (way_table(result),)),
    )


def variety_table(result: LatentSpaceResult) -> Table:
    """A row per number of views."""
    columns = [measured.column(_RATIO), Column("95 %")]
    for name, measure in VARIETY.items():
        columns += [measured.column(measure), *([Column("95 %")] if name in _RANGED else [])]
    rows = []
    for count in result.counts:
        ratio = result.ratio(count)
        cells: list[Cell] = [ratio.mean, ranged(ratio, _RATIO)]
        for name, measure in VARIETY.items():
            interval = result.variety(count, name)
            cells += [
                measure.shown(interval.mean),
                *([ranged(interval, measure)] if name in _RANGED else []),
            ]
        rows.append((f"{count} view" + "s" * (count > 1), tuple(cells)))
    note = (
        f"{len(result.scenes)} scenes, {result.samples} codes each, the same for all numbers of "
        "views. Distances: 1 - IoU of what is occupied, and of matched instances. Variety by "
        "error: distance among draws by that to the truth; 1 if draws are of what is possible, 0 "
        "if codes say nothing. Seen, of what differs: of the voxels that not all draws occupy. "
        "Ranges: 95 % bootstrap bounds over scenes."
    )
    return Table("What codes change", tuple(columns), tuple(rows), note=note)


def way_table(result: LatentSpaceResult) -> Table:
    """Ways through codes, and through means of both volumes."""
    columns: list[Column] = []
    for measure in WAYS.values():
        columns += [measured.column(measure), Column("95 %")]
    rows = []
    for kind, words in _KINDS.items():
        cells: list[Cell] = []
        for name, measure in WAYS.items():
            interval = result.way(kind, name)
            cells += (
                [measure.shown(interval.mean), ranged(interval, measure)]
                if interval
                else [None, None]
            )
        rows.append((words, tuple(cells)))
    note = (
        f"{result.steps} steps between two drawn codes on the sphere that codes lie near, given "
        f"one view. Length 1 is the direct way; equal steps would be "
        f"{100 / result.steps:.0f} % each. Errors: 1 - IoU with the true shape."
    )
    return Table("Ways between draws", tuple(columns), tuple(rows), note=note)


SECTIONS: dict[type, Show] = {LatentSpaceResult: lambda result, _: latent_space_sections(result)}
