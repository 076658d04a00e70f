"""Measures of this chapter, by evaluation."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from scenefw.core.measures import Measure
from scenefw_labelling_studies import published

_SCENES = {"scenes": Measure("scenes", digits=0), "frames": Measure("frames", digits=0)}
RULES = ("rule", "rule_easy")
"""Strategies that learn nothing, which the others are to beat."""
_SHORT = {"view_based": "views", "map_based": "map"}
SCORES = {
    "miou": Measure("mean IoU", better="higher"),
    "miou_low": Measure("mean IoU, low", "mean IoU, lower bound (95 %)"),
    "miou_high": Measure("mean IoU, high", "mean IoU, upper bound (95 %)"),
    "miou_seen": Measure("over seen", "mean IoU over seen vertices", better="higher"),
    "coverage": Measure("coverage", "share of vertices seen", better="higher"),
    "seconds": Measure("processing", "processing time", "s", 2, "lower"),
    "height_rms": Measure("height RMS", "RMS error of heights", "mm", 2, "lower", 1000.0),
    "height_median": Measure(
        "height median", "median error of heights", "mm", 2, "lower", 1000.0
    ),
}  # fmt: skip
"""A labelled map compared with the true one."""
HALVES = {
    "overlap": Measure("seen by both", "share of seen vertices that both halves see", "", 3),
    "height_median": Measure(
        "heights apart, median", "median difference of heights", "mm", 2, "lower", 1000.0
    ),
    "height_rms": Measure(
        "heights apart, RMS", "RMS difference of heights", "mm", 2, "lower", 1000.0
    ),
    "tilt": Measure("tilt", "tilt of the table", "degrees", 2, "lower"),
    "roughness": Measure(
        "roughness", "deviation of the table from a plane", "mm", 2, "lower", 1000.0
    ),
    "agreement": Measure(
        "same label", "share of vertices with the same label", better="higher", trivial="chance"
    ),
    "chance": Measure(
        "same label by chance", "the same for labels drawn at random in those shares"
    ),
    "miou": Measure(
        "mean IoU of halves", "mean IoU of the labels of one half by the other's", better="higher"
    ),
}
"""Two halves of one recording."""


def of_curves(strategies: Sequence[str]) -> dict[str, Measure]:
    """Measures of scores after all frames, `<strategy>/<score>`."""
    measures = dict(_SCENES)
    rule = next((name for name in strategies if name in RULES), None)
    for strategy in strategies:
        for name, measure in SCORES.items():
            theirs = published.FINAL.get(strategy) if name == "miou" else None
            learned = rule is not None and strategy != rule and name in ("miou", "miou_seen")
            measures[f"{strategy}/{name}"] = measure.changed(
                {
                    "heading": f"{measure.heading}, {_short(strategy)}",
                    "name": f"{measure.name or measure.heading}, {strategy.replace('_', '-')}",
                    "published": theirs.mean if theirs else None,
                    "trivial": f"{rule}/{name}" if learned else None,
                }
            )
    return measures


def of_noise(strategies: Sequence[str], amounts: Iterable[str]) -> dict[str, Measure]:
    """Measures of the mean IoU under each amount of noise, `<strategy>/<amount>`."""
    cells = [(strategy, amount) for strategy in strategies for amount in amounts]
    return {"scenes": _SCENES["scenes"]} | {
        f"{strategy}/{amount}": Measure(
            f"{_short(strategy)}, {amount}",
            f"mean IoU, {strategy.replace('_', '-')}, {amount}",
            better="higher",
        )
        for strategy, amount in cells
    }


def of_networks(kinds: Sequence[str], classes: Sequence[str]) -> dict[str, Measure]:
    """Measures of IoUs, `<kind>/<class>`, and their means, with table 4.1 of the thesis."""
    measures = {}
    for kind in kinds:
        theirs = dict(zip(published.CLASSES, published.CLASS_IOU.get(kind, ()), strict=False))
        measures[f"{kind}/miou"] = Measure(
            "class mean",
            "mean IoU over classes",
            better="higher",
            published=sum(theirs.values()) / len(theirs) if theirs else None,
        )
        measures[f"{kind}/weighted_iou"] = Measure(
            "frequency-weighted",
            "frequency-weighted IoU",
            better="higher",
            published=published.PRINTED_MEAN.get(kind),
        )
        for label in classes:
            measures[f"{kind}/{label}"] = Measure(
                label,
                f"IoU of {label.replace('_', ' ')}",
                better="higher",
                published=theirs.get(label),
            )
        measures[f"{kind}/number"] = Measure(kind, f"{kind} scored", digits=0)
    return measures


def of_times(names: Iterable[str]) -> dict[str, Measure]:
    """Measures of times and memory, whose names end in the unit."""
    measures = dict(_SCENES)
    for name in names:
        words, unit = name.rsplit(" ", 1)
        measures[name] = Measure(
            words.replace("/", ", "), unit=unit, digits=2 if unit == "ms" else 0, better="lower"
        )
    return measures


def of_weights(weights: Iterable[str]) -> dict[str, Measure]:
    """Measures of the weights of the hybrid's pool, and of its accuracy with them."""
    measures = {name: Measure(name.replace("/", ", "), digits=4) for name in weights}
    for name in ("views", "map", "pool"):
        measures[f"accuracy/{name}"] = Measure(
            name, f"labelled right, mean over classes, {name}", digits=4, better="higher"
        )
    return measures | {"vertices": Measure("vertices", digits=0), "scenes": _SCENES["scenes"]}


def of_halves(strategies: Sequence[str]) -> dict[str, Measure]:
    """Measures of the agreement of two halves of a recording, `<strategy>/<measure>`."""
    measures = {"frames": _SCENES["frames"]}
    for strategy in strategies:
        for name, measure in HALVES.items():
            heading = f"{measure.heading}, {_short(strategy)}"
            measures[f"{strategy}/{name}"] = measure.within(strategy).changed({"heading": heading})
    return measures


def _short(strategy: str) -> str:
    return _SHORT.get(strategy, strategy)
