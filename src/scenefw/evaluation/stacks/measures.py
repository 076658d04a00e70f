"""Measures of reconstructions of simulated stacks."""

from collections.abc import Sequence
from dataclasses import replace

from scenefw.core.measures import Measure
from scenefw.evaluation.stacks import published
from scenefw.evaluation.stacks.methods import BASE_RATE, REFERENCES, described

_TRIVIAL = {"occupancy_bce": BASE_RATE}  # of figures that are no measure of skill

COUNT_ERROR = Measure("count error", "objects too many or too few", digits=2, better="lower")
"""Of any count of objects."""
_SCORES = {
    "chamfer_visible": Measure(
        "Chamfer visible", "Chamfer, visible, as the thesis measures", "m", better="lower",
        floor="chamfer_visible_floor",
    ),
    "chamfer_full": Measure(
        "Chamfer full", "Chamfer, whole, as the thesis measures", "m", better="lower",
        floor="chamfer_full_floor",
    ),
    "chamfer_visible_excess": Measure(
        "visible, excess", "Chamfer, visible: excess", "mm", 1, "lower", 1000.0
    ),
    "chamfer_full_excess": Measure(
        "full, excess", "Chamfer, whole: excess", "mm", 1, "lower", 1000.0
    ),
    "chamfer_full_dense": Measure(
        "full, dense", "Chamfer, whole, from many points", "mm", 1, "lower", 1000.0
    ),
    "fscore_1cm": Measure("F at 1 cm", better="higher"),
    "normal_consistency": Measure("normals", "normals (mean cosine)", better="higher"),
    "occupancy_bce": Measure(
        "BCE of occupancy", "BCE of expected occupancy", better="lower"
    ),
    "occupancy_bce_probability": Measure(
        "BCE of probability", "BCE of the probability of being occupied", better="lower"
    ),
    "occupancy_iou": Measure("occupancy IoU", better="higher"),
    "hidden_coverage": Measure("hidden in spread", "hidden voxels within the samples' spread"),
    "instance_iou": Measure("instance IoU", better="higher"),
    "panoptic_quality": Measure("panoptic quality", better="higher"),
    "instance_recall": Measure("found", "objects found (IoU > 0.5)", better="higher"),
    "count_error": COUNT_ERROR,
    "count_excess": Measure("too many", "objects too many", digits=2),
}  # fmt: skip
_NUMBERS = {
    "visibility": Measure("visible", "visible share of the true surface"),
    "scenes": Measure("scenes", digits=0),
    "views": Measure("views", digits=0),
    "samples": Measure("samples", "samples of each view", digits=0),
}


def of_scores(
    methods: Sequence[str], sampled_methods: Sequence[str] = (), data: str | None = "superquadrics"
) -> dict[str, Measure]:
    """Measures of the scores of methods, the main one first, and of their numbers.

    Args:
        methods: names; figures of all but the first one begin with theirs.
        sampled_methods: methods whose samples are judged as samples.
        data: of table 5.1, whose figures stand beside the main method's; None has none.
    """
    theirs = {name: figure.mean for name, figure in published.thesis_figures(data).items()}
    measures = {
        name: replace(measure, trivial=_trivial(name, methods[1:]), published=theirs.get(name))
        for name, measure in _SCORES.items()
    }
    for method in methods[1:]:
        description = described(method)
        for name, measure in _SCORES.items():
            measures[f"{method}/{name}"] = replace(
                measure,
                heading=measure.heading + description.figure,
                name=(measure.name or measure.heading) + description.figure,
                trivial=_trivial(name, methods[1:]) if description.learns else None,
            )
    return measures | _NUMBERS | _of_draws(sampled_methods)


def _trivial(name: str, methods: Sequence[str]) -> str | None:
    method = _TRIVIAL.get(name) or _without_learning(methods)
    return f"{method}/{name}" if method in methods else None


def _without_learning(methods: Sequence[str]) -> str | None:
    """The strongest of the methods that learns nothing."""
    return next((name for name in REFERENCES if name in methods), None)


DRAWS = {
    "log_skill": Measure("log skill", "log skill of occupancy", "%", 1, "higher", 100.0),
    "brier_skill": Measure("Brier skill", "Brier skill of occupancy", "%", 1, "higher", 100.0),
    "log_skill_unseen": Measure(
        "log skill, unseen", "log skill of unseen space", "%", 1, "higher", 100.0
    ),
    "brier_skill_unseen": Measure(
        "Brier skill, unseen", "Brier skill of unseen space", "%", 1, "higher", 100.0
    ),
    "unseen_error": Measure(
        "calibration error, unseen", "calibration error of unseen space", "%", 2, "lower", 100.0
    ),
    "coverage": Measure("hidden in spread", "hidden voxels within the samples' spread"),
    "distance": Measure("mean of draws", "distance of objects, mean of draws", better="lower"),
    "distance_best_1": Measure("first", "distance of objects, first draw", better="lower"),
    "distance_best_3": Measure("best of 3", "distance of objects, best of 3", better="lower"),
    "distance_best_10": Measure("best of 10", "distance of objects, best of 10", better="lower"),
    "energy": Measure("energy score", "energy score of objects", better="lower"),
    "spread": Measure("among draws", "distance of objects among draws"),
    "instance_iou": Measure("instance IoU, mean", "instance IoU, mean of draws", better="higher"),
    "instance_iou_best_3": Measure("instance IoU, best of 3", better="higher"),
    "instance_iou_best_10": Measure("instance IoU, best of 10", better="higher"),
    "chamfer_visible_ratio": Measure(
        "visible, further draws by the first",
        "Chamfer distance of visible surfaces, further draws by the first",
        digits=2,
    ),
    "hidden_true": Measure("hidden objects", "hidden objects, mean of views", digits=2),
    "hidden_drawn": Measure("drawn", "hidden objects that are drawn", digits=2),
    "hidden_score": Measure(
        "score of their number", "score of the number of hidden objects", digits=3, better="lower"
    ),
    "trivial_hidden_score": Measure(
        "of validation scenes' numbers", "score of the numbers in validation scenes", digits=3
    ),
    "pairs_skill": Measure(
        "skill over distance", "one object or two: log skill", "%", 1, "higher", 100.0
    ),
    "pairs_skill_rate": Measure(
        "skill over rate", "one object or two: log skill over the rate", "%", 1, "higher", 100.0
    ),
    "pairs_log": Measure("log score", "one object or two: log score", "nats", 3, "lower"),
    "pairs_log_by_distance": Measure(
        "log score by distance", "one object or two: log score of the rate by distance", "nats"
    ),
    "pairs_log_rate": Measure(
        "log score of the rate", "one object or two: log score of the rate", "nats"
    ),
    "pairs_error": Measure(
        "calibration error", "one object or two: calibration error", "%", 1, "lower", 100.0
    ),
}
"""Of samples judged as samples."""


def _of_draws(methods: Sequence[str]) -> dict[str, Measure]:
    """Figures `draws/<method>/<name>`."""
    measures = {
        "draws/scenes": Measure("scenes of draws", digits=0),
        "draws/count": Measure("draws", "draws of each view", digits=0),
    }
    fits = "drawn_fits"  # where it is judged; draws beat what has none
    reference = fits if fits in methods else _without_learning(methods)
    for method in methods:
        words = described(method).draws
        for name, measure in DRAWS.items():
            baseline = described(method).learns and reference
            measures[f"draws/{method}/{name}"] = replace(
                measure,
                name=f"{measure.name or measure.heading}, {words}",
                trivial=f"draws/{reference}/{name}" if baseline else None,
            )
    return measures
