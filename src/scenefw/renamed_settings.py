"""Names that options and settings had before, so that who types them is told the new ones."""

from __future__ import annotations

from collections.abc import Mapping

OPTIONS: Mapping[str, str] = {
    "reconstructor=set_flow": "reconstructor=set_extents",
    "reconstructor=hidden_objects": "completion=hidden_objects",
    "reconstructor=by_evidence": "reconstructor=fitted",
    "reconstructor=part_guided": "reconstructor=fitted",
    "parts=affinity": "segmentation=affinity",
    "parts=creases": "segmentation=creases",
}
"""What was typed, and what is typed now."""

KEYS: Mapping[str, str] = {
    "parts": "segmentation",
    "fit.inner": "fit.single",
    "run.pipeline.reconstructor": "reconstructor",
    "run.pipeline.samples": "reconstructor.samples",
    "run.pipeline.seed": "seed",
    "run.pipeline.carve": "reconstructor.assembly.carve",
    "run.pipeline.ranking": "ranking",
    "run.pipeline.workspace": "observer.workspace",
    "run.pipeline.doctor": "observer.doctor",
    "run.pipeline.floor": "floor",
    "run.pipeline.mapping": "mapping",
    "reconstructor.inner.inner.grid": "reconstructor.grid",
    "reconstructor.inner.parts": "segmentation",
    "reconstructor.inner.grouping": "grouping",
    "reconstructor.checkpoint": "reconstructor.completion.checkpoint",
    "reconstructor.temperature": "reconstructor.completion.temperature",
    "reconstructor.smoothing": "reconstructor.completion.smoothing",
    "reconstructor.votes": "completion.median_of",
    "reconstructor.steps": "completion.steps",
    "reconstructor.spread": "completion.spread",
    "reconstructor.drawn_sigma": "completion.pseudo_sigma",
    "reconstructor.beyond": "completion.min_gap",
    "reconstructor.hidden": "completion.hidden",
    "reconstructor.drawn": "reconstructor.completion.drawn",
    "reconstructor.vessels": "hollow",
    "reconstructor.calibration": "reconstructor.assembly.calibration",
    "reconstructor.near": "tolerances.inlier_distance",
    "reconstructor.explained": "tolerances.min_inlier_ratio",
    "reconstructor.least": "reconstructor.fit.min_points",
    "reconstructor.lowest": "tolerances.min_height",
    "evaluation.methods.set_flow": "evaluation.methods.set_extents",
}
"""Beginnings of keys, and what they begin with now."""


def new_name(key: str, value: str) -> str | None:
    """What to type instead of a setting that was renamed; None if it wasn't.

    Args:
        key: without `+` and `~`.
        value: behind the `=`.
    """
    if f"{key}={value}" in OPTIONS:
        return OPTIONS[f"{key}={value}"]
    for old in sorted(KEYS, key=len, reverse=True):
        if key == old or key.startswith((f"{old}.", f"{old}@")):
            return f"{KEYS[old]}{key[len(old) :]}"
    return None
