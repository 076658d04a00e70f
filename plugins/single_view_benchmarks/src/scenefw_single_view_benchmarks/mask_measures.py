"""Measures of instances on labelled images."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from scenefw.core.measures import Measure
from scenefw.evaluation.stacks.measures import COUNT_ERROR
from scenefw_single_view_benchmarks import published_masks

_SCORES = {
    "overlap_f": Measure("overlap F", "", "%", 1, "higher", 100.0),
    "overlap_precision": Measure("P", "overlap precision", "%", 1, None, 100.0),
    "overlap_recall": Measure("R", "overlap recall", "%", 1, None, 100.0),
    "boundary_f": Measure("boundary F", "", "%", 1, "higher", 100.0),
    "boundary_precision": Measure("P", "boundary precision", "%", 1, None, 100.0),
    "boundary_recall": Measure("R", "boundary recall", "%", 1, None, 100.0),
    "objects_f75": Measure("objects F ≥ 75", "objects with F ≥ 0.75", "%", 1, "higher", 100.0),
    "seam_f": Measure("between objects F", "", "%", 1, "higher", 100.0),
    "seam_precision": Measure("P", "precision of borders between objects", "%", 1, None, 100.0),
    "seam_recall": Measure("R", "recall of borders between objects", "%", 1, None, 100.0),
    "count_error": COUNT_ERROR,
}
REFERENCE = "reference"


def at_margin(margin: float) -> str:
    """What names of figures begin with where points up to a height (m) count as floor."""
    return f"{1000 * margin:g} mm"


def of_images(
    margins: Sequence[float] = (), beside: Sequence[str] = (), *, published: bool = True
) -> dict[str, Measure]:
    """Measures of instances on labelled real images.

    Args:
        margins: heights (m) up to which points count as floor, beside the one that was chosen.
        beside: names of further methods.
        published: whether the images are of the data set that published figures are of.
    """
    measures = dict(REAL_IMAGES)
    if not published:
        measures = {name: replace(measure, published=None) for name, measure in measures.items()}
    ours = {n: m for n, m in REAL_IMAGES.items() if not n.startswith(f"{REFERENCE}/")}
    for method in beside:
        for name, measure in ours.items():
            called = f"{measure.name or measure.heading}, {method.replace('_', ' ')}"
            measures[f"{method}/{name}"] = replace(measure, name=called, published=None)
    for margin in margins:
        where = at_margin(margin)
        for prefix in ("", f"{REFERENCE}/"):
            for name in OF_MARGINS:
                measure = REAL_IMAGES[prefix + name]
                measures[f"{prefix}{where}/{name}"] = replace(
                    measure,
                    name=f"{measure.name or measure.heading}, floor up to {where}",
                    published=None,
                    trivial=None if prefix else f"{REFERENCE}/{where}/{name}",
                )
    return measures


OF_MARGINS = ("overlap_f", "boundary_f", "seam_f")
"""Figures that are also given at other margins."""


def _of_images() -> Mapping[str, Measure]:
    ours = {
        name: replace(
            measure,
            trivial=f"{REFERENCE}/{name}",
            published=getattr(published_masks.UOIS_NET, name, None),
        )
        for name, measure in _SCORES.items()
    }
    theirs = {
        f"{REFERENCE}/{name}": replace(
            measure, name=f"{measure.name or measure.heading}, without learning"
        )
        for name, measure in _SCORES.items()
    }
    numbers = {
        "images": Measure("images", digits=0),
        "failures": Measure("failures", "images that could not be used", digits=0),
    }
    return ours | theirs | numbers


REAL_IMAGES = _of_images()
"""Of instances on labelled real images."""
