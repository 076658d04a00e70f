"""Time of each stage, and memory (table 4.2)."""

from __future__ import annotations

from scenefw.report.blocks import Section
from scenefw.report.presentation import Show
from scenefw.report.tables import Cell, Column, Table
from scenefw_labelling_studies import published
from scenefw_labelling_studies.shared_parts import STAGES
from scenefw_labelling_studies.times import TimesResult


def times_sections(result: TimesResult) -> tuple[Section, ...]:
    """Table 4.2."""
    stages = [s for s in STAGES if any(s in times for times in result.milliseconds.values())]
    columns = (*(Column(f"{stage} (ms)", 2) for stage in stages), Column("per frame (ms)", 2))
    rows: list[tuple[str, tuple[Cell, ...]]] = [
        (name, (*(times.get(stage) for stage in stages), result.per_frame[name]))
        for name, times in result.milliseconds.items()
    ]
    rows.append(("thesis", (*(published.MILLISECONDS.get(stage) for stage in stages), None)))
    memory = ", ".join(f"{name} {value:.0f} MB" for name, value in result.memory.items())
    note = (
        f"Means over {result.scenes} scenes of {result.frames} frames on {result.device}; networks "
        "per pass, the other stages per frame. Per frame: all processing divided by the number of "
        f"frames, the map labelled once. The thesis: one GPU, 27 scenes, 1000 frames. Peak memory, "
        f"of all that this run has done so far: {memory}."
    )
    table = Table(
        "Time of each stage (table 4.2)", columns, tuple(rows), frozenset({"thesis"}), note
    )
    return (Section("Time and memory", (table,)),)


SECTIONS: dict[type, Show] = {TimesResult: lambda result, _: times_sections(result)}
