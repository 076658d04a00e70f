"""Labels under noise of poses and depth (figures 4.25, 4.26)."""

from __future__ import annotations

from pathlib import Path

from scenefw.report.blocks import Block, Drawing, Section, Text
from scenefw.report.measured import column
from scenefw.report.presentation import Show
from scenefw.report.tables import Cell, Column, Table
from scenefw_labelling_studies.measures import SCORES
from scenefw_labelling_studies.noise import SCORES_FILE, NoiseResult
from scenefw_labelling_studies.report.figures import Panel, bounds_figure, noise_figure
from scenefw_labelling_studies.report.wording import DEFINITION, bounds_text, listed
from scenefw_labelling_studies.results import HYBRID, write_scores


def noise_sections(result: NoiseResult, folder: Path) -> tuple[Section, ...]:
    """Figures 4.25 and 4.26; writes the scores."""
    write_scores(folder / SCORES_FILE, result.scores)
    count = len(result.scores.scenes)
    maps = {name: result.grid(name) for name in result.strategies}
    caption = (
        f"Mean IoU after {listed(result.scores.counts)} frames under Gaussian noise of camera "
        f"poses and of depth, mean over {count} scenes"
    )
    blocks: list[Block] = [Drawing(noise_figure(maps, result.pose, result.depth), caption)]
    blocks += _single_noises(result)
    blocks += [_noise_table(result), Text(DEFINITION)]
    return (Section("Labels under noise", tuple(blocks)),)


def _single_noises(result: NoiseResult) -> list[Block]:
    """Curves over one noise at the lowest amount of the other (figure 4.25)."""
    least_pose, least_depth = result.pose[0], result.depth[0]
    pose = {
        n: ([1e3 * p for p in result.pose], [result.cell(n, p, least_depth) for p in result.pose])
        for n in result.strategies
    }
    depth = {
        n: ([1e3 * d for d in result.depth], [result.cell(n, least_pose, d) for d in result.depth])
        for n in result.strategies
    }
    panels = (
        Panel("pose noise", "standard deviation (mm)", pose, {}),
        Panel("depth noise", "standard deviation (mm)", depth, {}),
    )
    count = len(result.scores.scenes)
    caption = f"One noise alone, with 95 % bounds over {count} scenes (figure 4.25)"
    return [Drawing(bounds_figure(panels, "mean IoU"), caption)]


def _noise_table(result: NoiseResult) -> Table:
    first, competitors = result.strategies[0], [n for n in result.strategies if n != HYBRID]
    compared = HYBRID in result.strategies and bool(competitors)
    columns = (
        *(Column(name, 3, None) for name in result.strategies),
        *([Column(f"{HYBRID} − best of the others", 3, None)] if compared else []),
        *([Column("paired 95 %", 3, None)] if compared else []),
        column(SCORES["height_rms"], ranked=False),
    )
    rows = []
    for p in result.pose:
        for d in result.depth:
            means = {name: result.cell(name, p, d).mean for name in result.strategies}
            cells: list[Cell] = list(means.values())
            if compared:
                best = max(competitors, key=means.__getitem__)
                gain = result.difference(HYBRID, best, p, d)
                cells += [gain.mean, bounds_text(gain)]
            cells.append(SCORES["height_rms"].shown(result.cell(first, p, d, "height_rms").mean))
            rows.append((f"pose {1000 * p:g} mm, depth {1000 * d:g} mm", tuple(cells)))
    return Table("Mean IoU under noise (figure 4.26)", columns, tuple(rows))


SECTIONS: dict[type, Show] = {NoiseResult: noise_sections}
