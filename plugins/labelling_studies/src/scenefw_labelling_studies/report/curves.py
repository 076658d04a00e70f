"""Labels against frames and time (figures 4.21, 4.23, 4.24)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scenefw.report.blocks import Drawing, Picture, Section, Text
from scenefw.report.measured import column
from scenefw.report.pictures import save_picture
from scenefw.report.presentation import Show
from scenefw.report.tables import Cell, Column, Table
from scenefw_labelling_studies import published
from scenefw_labelling_studies.curves import CurvesResult
from scenefw_labelling_studies.measures import SCORES
from scenefw_labelling_studies.report.example import example_picture
from scenefw_labelling_studies.report.figures import Panel, bounds_figure
from scenefw_labelling_studies.report.wording import DEFINITION, bounds_text, listed
from scenefw_labelling_studies.results import HYBRID, Scores, write_scores
from scenefw_labelling_studies.shared_parts import STAGES


def curves_sections(result: CurvesResult, folder: Path) -> tuple[Section, ...]:
    """Figures 4.23 and 4.24 and the pictures of figure 4.21; writes scores and pictures."""
    write_scores(folder / "curves.csv", result.scores)
    scores = result.scores
    parts = [
        Section(
            "Labels against frames and time",
            (
                Drawing(_curves(scores), _caption(scores)),
                _final(scores),
                _by_frames(scores),
                *_advantage(scores),
                Text(DEFINITION),
            ),
        ),
        Section("Classes, heights, times", (_classes(result), _heights(scores), _stages(result))),
    ]
    if result.example is not None:
        path = "pictures/labelling.png"
        save_picture(
            example_picture(result.example, result.classes, scores.strategies), folder / path
        )
        caption = f"First test scene after {listed(result.example.frames)} frames"
        parts.append(Section("Maps", (Picture(path, caption),)))
    return tuple(parts)


def _curves(scores: Scores) -> str:
    levels = {f"thesis, {name}": interval.mean for name, interval in published.FINAL.items()}
    by_frames = {name: (scores.counts, scores.curve(name, "miou")) for name in scores.strategies}
    by_time = {
        name: ([p.mean for p in scores.curve(name, "seconds")], scores.curve(name, "miou"))
        for name in scores.strategies
    }
    panels = (
        Panel("against frames", "frames", by_frames, levels),
        Panel("against processing time", "seconds", by_time, levels),
    )
    return bounds_figure(panels, "mean IoU")


def _caption(scores: Scores) -> str:
    return (
        f"Mean over {len(scores.scenes)} test scenes with 95 % bounds; dotted: the thesis after "
        f"{published.FRAMES} frames of {published.SCENES} scenes of its own, models of ShapeNet"
    )


def _final(scores: Scores) -> Table:
    columns = (
        column(SCORES["miou"]),
        Column("95 % bounds"),
        column(SCORES["miou_seen"], ranked=False),
    )
    rows: list[tuple[str, tuple[Cell, ...]]] = []
    for name in scores.strategies:
        miou, observed_miou = scores.final(name), scores.final(name, "miou_seen")
        rows.append((name, (miou.mean, bounds_text(miou), observed_miou.mean)))
    quoted = [
        (f"thesis, {name}", (interval.mean, bounds_text(interval), None))
        for name, interval in published.FINAL.items()
    ]
    title = f"Mean IoU after {scores.counts[-1]} frames, {len(scores.scenes)} scenes"
    note = "The thesis's scenes are others, with models of ShapeNet."
    return Table(title, columns, (*rows, *quoted), frozenset(name for name, _ in quoted), note)


def _by_frames(scores: Scores) -> Table:
    columns = (
        *(Column(name, 3) for name in scores.strategies),
        *(Column(f"{name}, over seen", 3) for name in scores.strategies),
        column(SCORES["coverage"], ranked=False),
    )
    curves = [scores.curve(n, m) for m in ("miou", "miou_seen") for n in scores.strategies]
    curves.append(scores.curve(scores.strategies[0], "coverage"))
    rows = tuple(
        (f"{frames} frames", tuple(curve[i].mean for curve in curves))
        for i, frames in enumerate(scores.counts)
    )
    return Table("Mean IoU by number of frames", columns, rows)


def _advantage(scores: Scores) -> tuple[Table, ...]:
    """How much better the hybrid is, scene by scene."""
    competitors = [name for name in scores.strategies if name != HYBRID]
    if HYBRID not in scores.strategies or not competitors:
        return ()
    columns = tuple(
        column for name in competitors for column in (Column(f"− {name}", 4), Column("95 % bounds"))
    )
    gains = {name: scores.advantage(HYBRID, name) for name in competitors}
    rows = tuple(
        (
            f"{frames} frames",
            tuple(c for n in competitors for c in (gains[n][i].mean, bounds_text(gains[n][i], 4))),
        )
        for i, frames in enumerate(scores.counts)
    )
    note = "Mean IoU of the hybrid minus that of another strategy on the same scene and frames."
    return (Table("The hybrid against the others, paired", columns, rows, note=note),)


def _classes(result: CurvesResult) -> Table:
    columns = tuple(Column(name, 3, "higher") for name in result.classes)
    rows = tuple(
        (name, tuple(None if np.isnan(v) else float(v) for v in ious))
        for name, ious in result.class_iou.items()
    )
    note = "Over the vertices of all scenes together."
    return Table("IoU by class after all frames", columns, rows, note=note)


def _heights(scores: Scores) -> Table:
    columns = (Column("RMS (mm)", 3), Column("median (mm)", 3), Column("coverage", 3))
    name = scores.strategies[0]
    curves = [scores.curve(name, m) for m in ("height_rms", "height_median", "coverage")]
    rows = tuple(
        (
            f"{frames} frames",
            tuple(s * c[i].mean for s, c in zip((1e3, 1e3, 1), curves, strict=True)),
        )
        for i, frames in enumerate(scores.counts)
    )
    note = "Errors of seen heights against the truth; the map is the same for all strategies."
    return Table("Heights", columns, rows, note=note)


def _stages(result: CurvesResult) -> Table:
    stages = [s for s in STAGES if any(s in times for times in result.seconds.values())]
    columns = tuple(Column(f"{stage} (s)", 2) for stage in stages)
    rows = tuple(
        (name, tuple(times.get(stage) for stage in stages))
        for name, times in result.seconds.items()
    )
    note = "Per scene, all frames; the map is labelled once, when it is read."
    return Table("Time of each stage", columns, rows, note=note)


SECTIONS: dict[type, Show] = {CurvesResult: curves_sections}
