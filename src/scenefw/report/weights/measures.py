"""The measures that sum up a network, beside those without learning and published ones."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from scenefw.core.errors import InputError
from scenefw.evaluation.labelling import published as labelling_published
from scenefw.evaluation.stacks import published, real_masks
from scenefw.report.stored import StoredRun
from scenefw.report.tables import Cell, Column

COLUMNS = (Column("scenefw"), Column("without learning"), Column("published"))
_PARTS = ("curves/", "networks/")  # of experiment=labelling, which has several evaluations


class Measure(NamedTuple):
    """A row: a figure of a run, how it is printed, and what is published of it."""

    row: str
    figure: str
    digits: int
    better: Literal["lower", "higher", ""] = "higher"
    factor: float = 1.0
    published: float | None = None
    brief: bool = True


@dataclass(frozen=True)
class Group:
    """Measures of one kind of evaluation.

    Args:
        name: one or two words.
        title: names the sample sizes by figures in braces, as rows may do.
        needs: figures by which a run of it is known.
        measures: the rows.
        reference: prefix of the figures of the method without learning.
        note: what the measures are.
    """

    name: str
    title: str
    needs: tuple[str, ...]
    measures: tuple[Measure, ...]
    reference: str | None = None
    note: str = ""

    def rows(
        self, figures: Mapping[str, float], *, brief: bool = False
    ) -> list[tuple[str, tuple[Cell, ...]]]:
        """Rows of the figures that are there; only the main ones if `brief`."""
        chosen = [m for m in self.measures if m.figure in figures and (m.brief or not brief)]
        return [(_name(m, figures), self._cells(m, figures)) for m in chosen]

    def _cells(self, measure: Measure, figures: Mapping[str, float]) -> tuple[Cell, ...]:
        reference = figures.get(f"{self.reference}{measure.figure}") if self.reference else None
        known = (figures[measure.figure], reference, measure.published)
        return tuple(None if v is None else _text(measure, v) for v in known)


def figures_of(run: StoredRun) -> dict[str, float]:
    """Figures of a run by the names that groups know."""
    return {_bare(name): value for name, value in run.figures.items()}


def groups_in(run: StoredRun, among: Sequence[Group]) -> tuple[Group, ...]:
    """The groups that a run has figures of.

    Raises:
        InputError: none of them.
    """
    figures = figures_of(run)
    found = tuple(group for group in among if all(name in figures for name in group.needs))
    if not found:
        wanted = " or ".join(", ".join(group.needs) for group in among)
        raise InputError(f"{run.path} has no figures to show here; expected {wanted}")
    return found


def _bare(name: str) -> str:
    return next((name.removeprefix(p) for p in _PARTS if name.startswith(p)), name)


def _name(measure: Measure, figures: Mapping[str, float]) -> str:
    arrow = {"lower": " \u2193", "higher": " \u2191", "": ""}[measure.better]
    return measure.row.format_map(figures) + arrow


def _text(measure: Measure, value: float) -> str:
    return f"{measure.factor * value:.{measure.digits}f}"


def _networks(kind: str, images: str) -> Group:
    """IoU of a network that labels, alone, beside table 4.1 of the thesis."""
    theirs = labelling_published.CLASS_IOU[kind]
    mean, printed = sum(theirs) / len(theirs), labelling_published.PRINTED_MEAN[kind]
    classes = [
        Measure(f"IoU of {label.replace('_', ' ')}", f"{kind}/{label}", 3, published=value)
        for label, value in zip(labelling_published.CLASSES, theirs, strict=True)
    ]
    measures = (
        Measure("mean IoU over classes", f"{kind}/miou", 3, published=mean),
        Measure("frequency-weighted IoU", f"{kind}/weighted_iou", 3, published=printed),
        *classes,
    )
    title = f"The network alone, {{{kind}/number:.0f}} {images}"
    return Group("Network", title, (f"{kind}/miou",), measures)


_THESIS = {name: figure.mean for name, figure in published.SUPERQUADRICS["SIMstack"].items()}

STACKS = Group(
    "Stacks",
    "Simulated stacks, {views:.0f} views of {scenes:.0f} test scenes, {samples:.0f} samples each",
    ("chamfer_full_excess", "partial_tsdf/chamfer_full_excess", "visibility"),
    (
        Measure("Chamfer, visible: excess (mm)", "chamfer_visible_excess", 1, "lower", 1000.0),
        Measure("Chamfer, whole: excess (mm)", "chamfer_full_excess", 1, "lower", 1000.0),
        Measure(
            "Chamfer, whole: excess of the zero code alone (mm)", "zero_code/chamfer_full_excess",
            1, "lower", 1000.0,
        ),
        Measure(
            "Chamfer, visible, as the thesis measures (m; floor {chamfer_visible_floor:.3f})",
            "chamfer_visible", 3, "lower", 1.0, _THESIS["chamfer_visible"],
        ),
        Measure(
            "Chamfer, whole, as the thesis measures (m; floor {chamfer_full_floor:.3f})",
            "chamfer_full", 3, "lower", 1.0, _THESIS["chamfer_full"],
        ),
        Measure(
            "BCE of expected occupancy", "occupancy_bce", 3, "lower", 1.0, _THESIS["occupancy_bce"]
        ),
        Measure("instance IoU", "instance_iou", 3),
        Measure("instance IoU of the zero code alone", "zero_code/instance_iou", 3),
        Measure("objects found (IoU > 0.5)", "instance_recall", 3, brief=False),
        Measure("objects too many or too few", "count_error", 2, "lower", brief=False),
        Measure("occupancy IoU", "occupancy_iou", 3, brief=False),
        Measure("F at 1 cm", "fscore_1cm", 3, brief=False),
        Measure("normals (mean cosine)", "normal_consistency", 3, brief=False),
        Measure("hidden voxels within the samples' spread", "hidden_coverage", 3, "", brief=False),
    ),
    "partial_tsdf/",
    "Excess: over the floor, which is the distance of two random samplings of one true surface. "
    "Without learning: the partial TSDF, meshed. Published: SIMstack, table 5.1 of the thesis. "
    "The zero code gives the most typical scene; samples are drawn together from N(0, I), as far "
    "apart as such codes can be (those of the thesis independently), and differ from it where the "
    "view is silent.",
)  # fmt: skip

IMAGES = Group(
    "Real images",
    "Real images of a depth camera, {images:.0f} labelled by hand",
    ("overlap_f", "reference/overlap_f"),
    (
        Measure("overlap F (%)", "overlap_f", 1, factor=100.0,
                published=real_masks.PUBLISHED["overlap_f"]),
        Measure("boundary F (%)", "boundary_f", 1, factor=100.0,
                published=real_masks.PUBLISHED["boundary_f"]),
        Measure("objects with F \u2265 0.75 (%)", "objects_f75", 1, factor=100.0),
        Measure("objects too many or too few", "count_error", 2, "lower"),
    ),
    "reference/",
    "Learning split of the Object Segmentation Database, on which the thresholds of the reference "
    "were chosen. Without learning: floor removed, components cut at depth jumps. Published: "
    "UOIS-Net-3D, depth only, on the whole of it, harder images included.",
)  # fmt: skip

LABELLING = Group(
    "Labelling",
    "Labelled height maps, mean IoU after {frames:.0f} frames of {scenes:.0f} simulated tables",
    ("view_based/miou", "map_based/miou", "hybrid/miou"),
    (
        Measure("view-based", "view_based/miou", 3,
                published=labelling_published.FINAL["view_based"].mean),
        Measure("map-based", "map_based/miou", 3,
                published=labelling_published.FINAL["map_based"].mean),
        Measure("hybrid", "hybrid/miou", 3),
    ),
    note="Published: the thesis, 1000 frames of 27 tables with models of ShapeNet.",
)  # fmt: skip

VIEWS = _networks("views", "test views")
MAPS = _networks("maps", "maps of test tables")
