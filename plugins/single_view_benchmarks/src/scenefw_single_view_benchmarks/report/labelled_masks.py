"""Results on labelled images: measures beside a reference and the published ones, pictures."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenefw.report.blocks import Picture, Section, Text
from scenefw.report.measured import column
from scenefw.report.palette import instance_colours
from scenefw.report.pictures import beside, save_picture
from scenefw.report.presentation import Show
from scenefw.report.tables import Column, Table
from scenefw_single_view_benchmarks import published_masks
from scenefw_single_view_benchmarks.labelled_masks import ImageResult, LabelledMaskResult
from scenefw_single_view_benchmarks.mask_measures import (
    OF_MARGINS,
    REAL_IMAGES,
    REFERENCE,
    at_margin,
)
from scenefw_single_view_benchmarks.mask_scores import borders

_SHOWN = (
    "overlap_f",
    "overlap_precision",
    "overlap_recall",
    "boundary_f",
    "boundary_precision",
    "boundary_recall",
    "objects_f75",
    "seam_f",
    "seam_precision",
    "seam_recall",
    "count_error",
)
_OURS, _REFERENCE = "set extents", "floor removed, cut at jumps and creases of depth"


def labelled_mask_sections(result: LabelledMaskResult, folder: Path) -> tuple[Section, ...]:
    """Tables, and pictures of the best, the median and the worst image, written into the folder."""
    failures = tuple(Text(f"{failed.name}: {failed.reason}") for failed in result.failures)
    pictures = _pictures(result, folder)
    return (
        Section(
            "Labelled images",
            (_measures(result), *_margins(result), _spread(result), *failures),
        ),
        Section("Best, median and worst image", pictures),
    )


def _measures(result: LabelledMaskResult) -> Table:
    figures = result.figures
    rows = [(_OURS, _cells(figures))]
    rows += [(name.replace("_", " "), _cells(figures, f"{name}/")) for name in result.beside]
    rows.append((_REFERENCE, _cells(figures, f"{REFERENCE}/")))
    published_rows = published_masks.ROWS if result.published else ()
    published = {f"{row.method}: {row.sees} (published)": row for row in published_rows}
    rows += [(name, _cells(row._asdict())) for name, row in published.items()]
    note = (
        f"Percent, means over {result.number} images{_failed(result)}; count error in objects per "
        "image. P precision, R recall. Between objects: borders where two objects' masks are "
        "within 3 pixels of each other, found within 3 pixels, pixels added up over all images; "
        "borders with the floor don't count. The row that cuts at jumps and creases learns "
        f"nothing.{result.about and ' '}{result.about}"
    )
    if published:
        note += (
            f" Published: {published_masks.SOURCE}; {published_masks.PROTOCOL}; harder images "
            "included."
        )
    columns = tuple(column(REAL_IMAGES[name], unit=False) for name in _SHOWN)
    return Table("Instances on labelled images", columns, tuple(rows), frozenset(published), note)


def _margins(result: LabelledMaskResult) -> tuple[Table, ...]:
    """Both methods by height that counts as floor."""
    if not result.margins:
        return ()
    figures = result.figures
    columns = tuple(
        Column(f"{who}{REAL_IMAGES[name].heading}", REAL_IMAGES[name].digits)
        for name in OF_MARGINS
        for who in ("", "reference ")
    )
    rows = tuple(
        (
            f"up to {at_margin(margin)}",
            tuple(
                REAL_IMAGES[name].shown(figures[f"{prefix}{at_margin(margin)}/{name}"])
                for name in OF_MARGINS
                for prefix in ("", f"{REFERENCE}/")
            ),
        )
        for margin in result.margins
    )
    note = (
        "Percent. Points up to this height above the floor belong to no object, for both methods. "
        "Boundary F depends on this height, as a line around each object moves; overlap F and "
        "borders between objects hardly do, unless "
        "so little counts as floor that its noise joins what the reference should separate. "
        "Reference: the row without learning."
    )
    return (Table("Heights that count as floor", columns, rows, note=note),)


def _failed(result: LabelledMaskResult) -> str:
    """How many images failed, and how they count."""
    if not result.failures:
        return ""
    unread = sum(failed.objects is None for failed in result.failures)
    unknown = f" (but for {unread}, whose labels can't be read)" if unread else ""
    return (
        f", of which {len(result.failures)} failed and count as 0 in both rows, all their objects "
        f"missed{unknown}"
    )


def _cells(figures: Mapping[str, float], prefix: str = "") -> tuple[float | None, ...]:
    values = {name: figures.get(prefix + name) for name in _SHOWN}
    return tuple(None if v is None else REAL_IMAGES[name].shown(v) for name, v in values.items())


def _spread(result: LabelledMaskResult) -> Table:
    """Best, quartiles and worst of both methods."""
    columns = tuple(
        Column(f"{name} {measure}", 1)
        for name in (_OURS, "reference")
        for measure in ("overlap F", "boundary F")
    )
    ours = [(s.overlap_f, s.boundary_f) for s in result.scores()]
    theirs = [(s.overlap_f, s.boundary_f) for s in result.scores("reference")]
    values = 100 * np.concatenate([ours, theirs], axis=1)
    quartiles = np.percentile(values, [100, 75, 50, 25, 0], axis=0)
    names = ("best", "upper quarter", "median", "lower quarter", "worst")
    rows = tuple((n, tuple(map(float, q))) for n, q in zip(names, quartiles, strict=True))
    return Table("Spread over images", columns, rows, note="Percent; columns sorted one by one.")


def _pictures(result: LabelledMaskResult, folder: Path) -> tuple[Picture, ...]:
    ranked = sorted(result.images, key=lambda image: -image.scores.overlap_f)
    places = {"best": 0, "median": len(ranked) // 2, "worst": len(ranked) - 1}
    pictures = []
    for word, place in places.items():
        image = ranked[place]
        path = f"gallery/{word}.jpg"
        save_picture(draw_masks(image), folder / path)
        caption = (
            f"{word}: {image.name}, overlap F {100 * image.scores.overlap_f:.1f}, boundary F "
            f"{100 * image.scores.boundary_f:.1f} (reference "
            f"{100 * image.reference.overlap_f:.1f}, {100 * image.reference.boundary_f:.1f})"
        )
        pictures.append(Picture(path, caption, shareable=False))
    return tuple(pictures)


def draw_masks(image: ImageResult) -> NDArray[np.float32]:
    """RGB in [0, 1]: the labels of person, method and reference over the colour image."""
    titles = {"true": "labels", "method": _OURS, "reference": "no learning"}
    tiles = [overlaid(image.colour, image.labels[key])[::2, ::2] for key in titles]
    return beside(tiles, list(titles.values()))


def overlaid(colour: NDArray[np.uint8] | None, labels: NDArray[np.integer]) -> NDArray[np.float32]:
    """RGB (H, W, 3) in [0, 1] of labels (H, W), <= 0 = none, over a grey colour image."""
    grey = np.full(labels.shape, 0.85) if colour is None else colour.mean(axis=-1) / 255
    picture = np.repeat(grey[..., None], 3, axis=-1)
    ids = np.unique(labels[labels > 0])
    for i, shade in zip(ids, instance_colours(len(ids)), strict=True):
        mask = labels == i
        picture[mask] = 0.4 * picture[mask] + 0.6 * np.array(shade)
        picture[borders(mask)] = np.array(shade) * 0.6
    return picture.astype(np.float32)


SECTIONS: dict[type, Show] = {LabelledMaskResult: labelled_mask_sections}
