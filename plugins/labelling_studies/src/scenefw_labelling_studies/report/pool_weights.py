"""The hybrid's weights."""

from __future__ import annotations

from dataclasses import asdict, astuple

from scenefw.report.blocks import Section, Text
from scenefw.report.presentation import Show
from scenefw.report.tables import Column, Table
from scenefw_labelling_studies.pool_weights import WeightsResult
from scenefw_labelling_studies.results import HYBRID


def weights_sections(result: WeightsResult) -> tuple[Section, ...]:
    """The hybrid's weights, ready for its config."""
    pools = result.pool.parts
    names = tuple(asdict(result.pool.surface))
    rows = tuple((part, astuple(weights)) for part, weights in pools.items())
    note = (
        f"From {result.vertices} vertices of {result.scenes} scenes, each class counting the same."
    )
    table = Table("Weights of the pool", tuple(Column(n, 4) for n in names), rows, note=note)
    accuracy = Table(
        "Share of these vertices labelled right",
        (Column("mean over classes", 4, "higher"),),
        tuple((name, (value,)) for name, value in result.accuracy.items()),
    )
    values = {
        f"{part}.{name}": value
        for part, weights in pools.items()
        for name, value in asdict(weights).items()
    } | {"doubt": result.pool.doubt}
    overrides = " ".join(f"labelling.{HYBRID}.pool.{k}={v:.4g}" for k, v in values.items())
    return (Section("Weights of the hybrid", (table, accuracy, Text(overrides))),)


SECTIONS: dict[type, Show] = {WeightsResult: lambda result, _: weights_sections(result)}
