"""What chosen grasps disturb, as tables and a figure, and films of some."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from scenefw.report import measured
from scenefw.report.blocks import Drawing, Picture, Section
from scenefw.report.figures import COLOURS, INK, STYLE, to_svg
from scenefw.report.pictures import save_picture
from scenefw.report.presentation import Show
from scenefw.report.stacks.draws import ranged
from scenefw.report.tables import Cell, Column, Table
from scenefw_grasping.choices import CHOSEN, MEAN, OF_A_SCENE, OF_AN_OBJECT, ORACLE
from scenefw_grasping.report.films import film_pictures, save_film
from scenefw_grasping.results import (
    ANY,
    GIVEN,
    SCORES,
    GraspExample,
    GraspingResult,
)

_NAMES = {
    CHOSEN: "least disturbance in the simulated prediction",
    "topmost": "topmost object (no simulation)",
    "least_neighbours": "least neighbours (no simulation)",
    "best_seal": "best seal (no simulation)",
    MEAN: "mean of all grasps",
    ORACLE: "best in the true scene (oracle)",
}
_TITLES = {ANY: "Grasps of any object", GIVEN: "Grasps of a given object"}
_SMALLEST = 0.05  # mm, in the figure


def grasping_sections(result: GraspingResult, folder: Path) -> tuple[Section, ...]:
    """Both tables, the figure, and films, which are written into the folder of the page."""
    tables = tuple(grasping_table(result, protocol) for protocol in (ANY, GIVEN))
    sections = [Section("Grasps that disturb nothing", (*tables, Drawing(_figure(result))))]
    if result.examples:
        blocks = tuple(block for example in result.examples for block in _films(example, folder))
        sections.append(Section("Chosen grasps, as predicted and as they went", blocks))
    return tuple(sections)


def grasping_table(result: GraspingResult, protocol: str) -> Table:
    """What becomes of each choice, with bounds."""
    columns: list[Column] = []
    for measure in SCORES.values():
        columns += [measured.column(measure), Column("95 %")]
    choices = OF_A_SCENE if protocol == ANY else OF_AN_OBJECT
    rows = [(_NAMES[choice], _cells(result, protocol, choice)) for choice in choices]
    quoted = frozenset({_NAMES[ORACLE]})
    return Table(_TITLES[protocol], tuple(columns), tuple(rows), quoted, _note(result, protocol))


def _cells(result: GraspingResult, protocol: str, choice: str) -> tuple[Cell, ...]:
    cells: list[Cell] = []
    for name, measure in SCORES.items():
        interval = result.interval(protocol, choice, name)
        cells += [measure.shown(interval.mean), ranged(interval, measure)]
    return tuple(cells)


def _note(result: GraspingResult, protocol: str) -> str:
    groups = result.groups[protocol]
    scenes = len({scene for scene, _ in groups})
    tries = sum(len(grasps) for _, grasps in groups)
    objects = "" if protocol == ANY else f", {len(groups)} objects with two grasps or more"
    baseline = "topmost" if protocol == ANY else "best_seal"
    versus = []
    for name in (baseline, MEAN):
        gain = result.gain(protocol, name, "disturbance")
        low, high = 1000 * gain.low, 1000 * gain.high
        label = _NAMES[name].split(" (")[0]
        versus.append(f"{label} {1000 * gain.mean:+.1f} mm ({low:+.1f} to {high:+.1f})")
    failures = result.failures(protocol, CHOSEN)
    why = ", ".join(f"{reason} ({count})" for reason, count in failures.most_common())
    return (
        f"{scenes} scenes{objects}, {tries} grasps, all simulated in the true scene. Others move: "
        f"mean displacement of the other objects. Clean: lifted, and nothing else moves by "
        f"{1000 * result.still:g} mm or more. Others move, first row minus {', '.join(versus)}. "
        f"Why lifts of the first row failed: {why or 'none did'}. {_without(result, protocol)}"
        "The oracle takes lifts that succeed first, so others may move more than with a choice "
        "that fails more often. "
        "Ranges: 95 % bootstrap bounds over scenes."
    )


def _without(result: GraspingResult, protocol: str) -> str:
    """What nobody can grasp."""
    if protocol != ANY:
        return ""
    none = sum(not scene.tries for scene in result.scenes)
    why = ", ".join(f"{reason} ({count})" for reason, count in result.reasons.most_common())
    objects = f"Predicted objects without a grasp: {why}. " if why else ""
    return f"Scenes without a grasp, not counted: {none}. {objects}"


def _figure(result: GraspingResult) -> str:
    """Share of scenes by disturbance, a line for each choice, failed lifts left out."""
    with rc_context(STYLE):
        figure = Figure(figsize=(8.0, 3.4), layout="constrained")
        for number, (protocol, choices) in enumerate(((ANY, OF_A_SCENE), (GIVEN, OF_AN_OBJECT))):
            axes = figure.add_subplot(1, 2, number + 1, title=_TITLES[protocol])
            for choice, colour in zip(OF_A_SCENE, COLOURS, strict=False):
                if choice not in choices or choice == MEAN:
                    continue
                values = result.values(protocol, choice)
                if not len(values):
                    continue
                displacements = np.where(
                    values[:, 1] > 0, np.inf, np.maximum(1000 * values[:, 0], 1e-6)
                )
                grid = np.geomspace(_SMALLEST, 300, 120)
                share = [100 * float((displacements <= limit).mean()) for limit in grid]
                axes.plot(grid, share, color=colour, label=_NAMES[choice].split(" (")[0])
            axes.set_xscale("log")
            axes.xaxis.set_major_formatter("{x:g}")
            axes.set(xlabel="others move by at most (mm)", ylim=(0, 101))
            axes.set_ylabel("lifted (%)" if not number else "")
            axes.grid(alpha=0.15, color=INK)
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3)
        return to_svg(figure)


def _films(example: GraspExample, folder: Path) -> tuple[Picture, ...]:
    name = f"gallery/grasp_{example.name.replace(' ', '_')}"
    films = [example.predicted, example.true]
    pictures = film_pictures(films, ["in the prediction", "in the true scene"], example.camera)
    save_film(folder / f"{name}.gif", pictures, example.true.seconds)
    strip = [pictures[round(i)] for i in np.linspace(0, len(pictures) - 1, 3)]
    save_picture(np.concatenate(strip, axis=0), folder / f"{name}.jpg")
    caption = f"{example.name}: {example.words}"
    return (Picture(f"{name}.jpg", caption, (("film (GIF)", f"{name}.gif"),)),)


SECTIONS: dict[type, Show] = {GraspingResult: grasping_sections}
