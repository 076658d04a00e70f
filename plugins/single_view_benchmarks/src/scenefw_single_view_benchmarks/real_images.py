"""Methods on groups of real depth images: masks where there are labels, oddities of all objects."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from scenefw.core.errors import ConfigError, InputError, LabelsError
from scenefw.core.measures import Measure
from scenefw.data.files.readers import find_images, read_frame
from scenefw.metrics.sampling import sample_surface
from scenefw.perception.evidence.mesh_distances import MeshDistances
from scenefw.perception.observation.points import world_points
from scenefw_single_view_benchmarks.labelled_masks import pixel_instances
from scenefw_single_view_benchmarks.mask_scores import MaskScores, mask_scores
from scenefw_single_view_benchmarks.sanity import FLAGS, sanity

if TYPE_CHECKING:
    from scenefw.core.protocols import Track
    from scenefw.core.types import Float64, Frame, Int32, SceneEstimate, TriangleMesh
    from scenefw_single_view_benchmarks.labelled_masks import Estimator, TrueLabels

RISING = "rising"
"""Row of the trivial mask: all that rises above the floor is one object."""
_MARGIN = 0.005  # m above the floor: what is higher rises
_INTERIOR = 4000  # places in the box of an object, of which those inside it are examined
_SURFACE = 2000  # points on each other object, on which one may stand


@dataclass(frozen=True)
class Row:
    """What a method makes of one image.

    Args:
        refused: why the image can't be used, in one line; empty if it can.
        objects: predicted.
        true: labelled; None: the image has no labels.
        strict: scores of masks where all that is unlabelled is no object; None without labels.
        cut: the same where only labelled pixels count.
        flags: of each odd object.
        obstacles: found.
    """

    refused: str = ""
    objects: int = 0
    true: int | None = None
    strict: MaskScores | None = None
    cut: MaskScores | None = None
    flags: tuple[frozenset[str], ...] = ()
    obstacles: int = 0


@dataclass(frozen=True)
class RealImage:
    """One image.

    Args:
        name: of its file.
        rows: of each method.
        true: (H, W) labels, -1 = unknown, or None.
        estimate: of the first method; None: it refuses the image.
        frame: as it was read; None: it can't be read.
    """

    name: str
    rows: Mapping[str, Row]
    true: Int32 | None = None
    estimate: SceneEstimate | None = None
    frame: Frame | None = None


class Earlier(NamedTuple):
    """Figures of a commit before, for a row of each group.

    Args:
        name: of the row.
        figures: by group and name.
    """

    name: str
    figures: Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class RealImageResult:
    """Images by group.

    Args:
        groups: images of each.
        about: the images, in sentences.
        earlier: figures of an earlier commit.
    """

    groups: Mapping[str, Sequence[RealImage]]
    about: str = ""
    earlier: Earlier = field(default_factory=lambda: Earlier("", {}))

    @property
    def methods(self) -> tuple[str, ...]:
        """Names, the main one first."""
        return tuple(next(images[0] for images in self.groups.values() if images).rows)

    def of(self, group: str, method: str) -> dict[str, float]:
        """Figures of a method by name; those of masks only where there are labels."""
        rows = [image.rows[method] for image in self.groups[group]]
        return _figures(rows, examined=method != RISING)

    @property
    def figures(self) -> dict[str, float]:
        """Figures `<group>/<method>/<name>`."""
        return {
            f"{group}/{method}/{name}": value
            for group in self.groups
            for method in self.methods
            for name, value in self.of(group, method).items()
        }

    @property
    def measures(self) -> dict[str, Measure]:
        """Units and digits; a network's masks are compared with the trivial ones."""
        return {
            f"{group}/{method}/{name}": replace(
                measure,
                name=f"{measure.name or measure.heading}, {method.replace('_', ' ')}, {group}",
                trivial=f"{group}/{self.methods[-1]}/{name}" if index == 0 else None,
            )
            for group in self.groups
            for index, method in enumerate(self.methods)
            for name, measure in MEASURES.items()
        }


MEASURES = {
    "images": Measure("images", digits=0),
    "refused": Measure("refused", "images refused", digits=0, better="lower"),
    "objects": Measure("objects", "objects predicted", digits=0),
    "true_objects": Measure("true", "objects labelled", digits=0),
    "count_error": Measure("count error", "objects too many or too few", digits=2, better="lower"),
    "overlap_f": Measure("overlap F", "", "%", 1, "higher", 100.0),
    "boundary_f": Measure("boundary F", "", "%", 1, "higher", 100.0),
    "cut_overlap_f": Measure("cut: overlap F", "", "%", 1, "higher", 100.0),
    "cut_boundary_f": Measure("boundary F", "cut: boundary F", "%", 1, "higher", 100.0),
    "flagged": Measure("flagged", "odd objects", digits=0, better="lower"),
    **{
        flag: Measure(flag, f"objects flagged as {flag}", digits=0, better="lower")
        for flag in FLAGS
    },
    "obstacles": Measure("obstacles", "obstacles found", digits=0),
}


class RealImages:
    """Scores methods on groups of real images, labelled or not.

    An image that a method refuses scores 0, and all its objects are missed. A last row `rising`
    takes all that rises above the floor for one object.

    Args:
        input: a folder of depth images, or one whose folders hold some; deeper ones don't count.
        methods: by name, the main one first; None leaves one out.
        labels: by name, what is asked for them, one after another.
        tolerance: see `mask_scores.mask_scores`.
        about: the images, for readers of the table, in sentences.
        earlier: figures of an earlier commit: its `name`, and `figures` by group.

    Raises:
        ConfigError: no input is given, or no method.
    """

    def __init__(
        self,
        input: str | Path | None,  # noqa: A002 - named as the setting on the command line
        methods: Mapping[str, Estimator | None],
        labels: Mapping[str, TrueLabels | None],
        tolerance: float = 0.003,
        about: str = "",
        earlier: Mapping[str, object] | None = None,
    ) -> None:
        if input is None:
            raise ConfigError("scores on real images need input=FOLDER of groups of depth images")
        self.input = Path(input)
        self.methods = {name: method for name, method in methods.items() if method is not None}
        if not self.methods:
            raise ConfigError("nothing to evaluate; leave one of evaluation.methods in")
        self.labels = [source for source in labels.values() if source is not None]
        self.tolerance, self.about = tolerance, about
        self.earlier = Earlier(**earlier) if earlier else Earlier("", {})  # type: ignore[arg-type]

    def run(self, track: Track = lambda paths, _: paths) -> RealImageResult:
        """Scores every image; `track` wraps the loop in a progress bar.

        Raises:
            LabelsError: labels can't be read, or are of images of another size.
            InputError: there is no image.
        """
        groups: dict[str, list[RealImage]] = {}
        for path in track(_grouped(self.input), "images"):
            groups.setdefault(path.parent.name, []).append(self._image(path))
        return RealImageResult(groups, self.about, self.earlier)

    def _image(self, path: Path) -> RealImage:
        try:
            frame, true = read_frame(path), self._true(path)
        except LabelsError:
            raise
        except InputError as error:
            row = Row(str(error))  # its labels, if it has some, can't be read either
            return RealImage(path.stem, dict.fromkeys([*self.methods, RISING], row))
        if true is not None and true.shape != frame.depth.shape:
            raise LabelsError(
                f"labels of {path.name} are of {true.shape[1]} x {true.shape[0]} pixels, its depth "
                f"of {frame.camera.width} x {frame.camera.height}; label images of one size"
            )
        estimates = {name: _estimate(method, frame) for name, method in self.methods.items()}
        rows = {name: self._row(estimate, frame, true) for name, estimate in estimates.items()}
        first = next(iter(estimates.values()))
        rows[RISING] = self._rising(first, true)
        return RealImage(path.stem, rows, true, None if isinstance(first, str) else first, frame)

    def _true(self, path: Path) -> Int32 | None:
        labels = (source.of(path) for source in self.labels)
        return next((true for true in labels if true is not None), None)

    def _row(self, estimate: SceneEstimate | str, frame: Frame, true: Int32 | None) -> Row:
        if isinstance(estimate, str):
            return self._scored(Row(estimate), None, true)
        flags = tuple(filter(None, odd_objects(estimate, frame).values()))
        row = Row("", len(estimate.objects), flags=flags, obstacles=len(estimate.obstacles))
        return self._scored(row, pixel_instances(estimate), true)

    def _rising(self, estimate: SceneEstimate | str, true: Int32 | None) -> Row:
        """The trivial mask of what stands in the workspace of the first method."""
        if isinstance(estimate, str):
            return self._scored(Row(estimate), None, true)
        rising = world_points(estimate.frame)[..., 2] > _MARGIN  # NaN where no depth: not above
        return self._scored(Row("", int(rising.any())), rising.astype(np.int32), true)

    def _scored(self, row: Row, masks: Int32 | None, true: Int32 | None) -> Row:
        if true is None:
            return row
        masks = np.zeros_like(true) if masks is None else masks
        strict = mask_scores(masks, np.maximum(true, 0), self.tolerance)
        cut = mask_scores(masks, true, self.tolerance)
        if row.refused:
            strict, cut = (replace(s, overlap_f=0.0, boundary_f=0.0) for s in (strict, cut))
        return replace(row, true=_count(true), strict=strict, cut=cut)


def odd_objects(estimate: SceneEstimate, frame: Frame) -> dict[int, frozenset[str]]:
    """What is odd about each object of a scene, by its id.

    Args:
        estimate: the scene.
        frame: the whole image, whose camera stands where the estimate says.
    """
    camera = estimate.frame.camera
    points, masks = world_points(replace(frame, camera=camera)), pixel_instances(estimate)
    meshes = {item.id: item.mesh for item in estimate.objects}
    surfaces = {label: _surface(mesh) for label, mesh in meshes.items()}
    return {
        label: sanity(
            mesh.vertices,
            _interior(mesh),
            points[(masks == label) & (frame.depth > 0)],
            np.concatenate([np.zeros((0, 3)), *(p for k, p in surfaces.items() if k != label)]),
            frame.depth,
            camera,
        ).flags
        for label, mesh in meshes.items()
    }


def _interior(mesh: TriangleMesh) -> Float64:
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    places = np.random.default_rng(0).uniform(low, high, (_INTERIOR, 3))
    return places[MeshDistances(mesh).inside(places)]


def _surface(mesh: TriangleMesh) -> Float64:
    """Corners, and points between them."""
    random = np.random.default_rng(0)
    return np.concatenate([mesh.vertices, sample_surface(mesh, _SURFACE, random).points])


def _estimate(method: Estimator, frame: Frame) -> SceneEstimate | str:
    """The scene, or why there is none."""
    try:
        return method.estimate(frame)
    except InputError as error:
        return str(error)


def _grouped(folder: Path) -> list[Path]:
    """Images of a folder, or of the folders in it."""
    if folder.is_dir():
        folders = [folder, *sorted(path for path in folder.iterdir() if path.is_dir())]
    else:
        folders = [folder]
    images = [path for part in folders for path in _images_of(part)]
    if not images:
        raise InputError(f"no depth image in {folder} or its folders; give input=FOLDER")
    return images


def _images_of(folder: Path) -> list[Path]:
    try:
        return [path for path in find_images(folder) if folder in (path, path.parent)]
    except InputError:
        return []


def _count(true: Int32) -> int:
    return len(np.unique(true[true > 0]))


def _figures(rows: Sequence[Row], *, examined: bool) -> dict[str, float]:
    labelled = [row for row in rows if row.true is not None]
    figures: dict[str, float] = {
        "images": len(rows),
        "refused": sum(bool(row.refused) for row in rows),
        "objects": sum(row.objects for row in rows),
    }
    if labelled:
        figures["true_objects"] = sum(row.true or 0 for row in labelled)
        figures["count_error"] = _mean(abs(row.objects - (row.true or 0)) for row in labelled)
        for prefix, scores in (("", "strict"), ("cut_", "cut")):
            for name in ("overlap_f", "boundary_f"):
                values = (getattr(getattr(row, scores), name, 0.0) for row in labelled)
                figures[prefix + name] = _mean(values)
    if examined:
        flags = [flag for row in rows for flag in row.flags]
        figures["flagged"] = len(flags)
        figures |= {name: sum(name in flag for flag in flags) for name in FLAGS}
        figures["obstacles"] = sum(row.obstacles for row in rows)
    return {name: float(value) for name, value in figures.items()}


def _mean(values: Iterable[float]) -> float:
    return float(np.mean(list(values)))
