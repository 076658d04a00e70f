"""Results on groups of real images: a table of each, its refused images, and pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenefw.evaluation.stacks.methods import described
from scenefw.report.blocks import Picture, Points, Section
from scenefw.report.measured import column
from scenefw.report.palette import instance_colours
from scenefw.report.pictures import beside, save_picture
from scenefw.report.solids import solid_of
from scenefw.report.tables import Table
from scenefw.report.window import two_views
from scenefw_single_view_benchmarks.real_images import MEASURES, RISING, RealImage, RealImageResult
from scenefw_single_view_benchmarks.report.labelled_masks import overlaid
from scenefw_single_view_benchmarks.sanity import (
    FLAGS,
    MAX_BELOW,
    MAX_FREE_RATIO,
    MAX_GAP,
    MAX_LENGTH_RATIO,
    MIN_FREE_DISTANCE,
    MIN_LENGTH,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from scenefw.report.presentation import Show

OF_OBJECTS = ("objects", "flagged", *FLAGS, "obstacles")
OF_MASKS = tuple(name for name in MEASURES if name not in OF_OBJECTS[1:])


def real_image_sections(result: RealImageResult, folder: Path) -> tuple[Section, ...]:
    """A section for each group; pictures are written into the folder.

    They are of the image with the most odd objects, or else the worst masks, and of the median one.
    """
    return tuple(
        Section(
            group.replace("_", " "),
            (*_tables(result, group), *_refused(result, group), *_pictures(result, group, folder)),
        )
        for group in result.groups
    )


def _tables(result: RealImageResult, group: str) -> tuple[Table, ...]:
    """Masks, where there are labels, and all objects."""
    is_first = group == next(iter(result.groups))
    of_main = result.of(group, result.methods[0])
    of_masks = _table(result, group, "Masks", [n for n in OF_MASKS if n in of_main], "")
    of_objects = _table(result, group, "Objects", OF_OBJECTS, _note(result) if is_first else "")
    return (of_masks, of_objects) if "overlap_f" in of_main else (of_objects,)


def _table(
    result: RealImageResult, group: str, title: str, names: Sequence[str], note: str
) -> Table:
    figures = {_row_name(method): result.of(group, method) for method in result.methods}
    quoted = frozenset({result.earlier.name} if group in result.earlier.figures else ())
    figures |= {name: dict(result.earlier.figures[group]) for name in quoted}
    rows = {name: _cells(of_row, names) for name, of_row in figures.items()}
    columns = tuple(column(MEASURES[name], unit=False) for name in names)
    told = {name: cells for name, cells in rows.items() if any(c is not None for c in cells[1:])}
    return Table(title, columns, tuple(told.items()), quoted, note)


def _note(result: RealImageResult) -> str:
    flags = (
        f"Flagged objects: below, by more than {100 * MAX_BELOW:g} cm under the floor; long, more "
        f"than {MAX_LENGTH_RATIO:g} times as long as what is visible and longer than "
        f"{100 * MIN_LENGTH:g} cm; free, more than {MAX_FREE_RATIO:.0%} of the volume over "
        f"{1000 * MIN_FREE_DISTANCE:g} mm in front of what is measured; hovering, by more than "
        f"{1000 * MAX_GAP:g} mm; unseen, without pixels."
    )
    return (
        "Sums over images; count error and F (percent) are means over labelled ones, in which a "
        "refused image has 0 and misses all its objects. Strict scores take all that is unlabelled "
        "for no object; cut: what lies off labelled objects doesn't count where labels say that "
        f"they are unknown. {flags}{result.about and ' '}{result.about}"
    )


def _row_name(method: str) -> str:
    return "one object: all that rises" if method == RISING else described(method).row


def _cells(figures: Mapping[str, float], names: Sequence[str]) -> tuple[float | None, ...]:
    return tuple(MEASURES[n].shown(figures[n]) if n in figures else None for n in names)


def _refused(result: RealImageResult, group: str) -> tuple[Points, ...]:
    lines = {
        f"{image.name} ({_row_name(method)}): {image.rows[method].refused}"
        for image in result.groups[group]
        for method in result.methods
        if method != RISING and image.rows[method].refused
    }
    return (Points(tuple(sorted(lines))),) if lines else ()


def _pictures(result: RealImageResult, group: str, folder: Path) -> list[Picture]:
    main = result.methods[0]
    images = [image for image in result.groups[group] if image.estimate is not None]
    ranked = sorted(images, key=lambda image: _badness(image, main))
    middle = ranked[len(ranked) // 2 : len(ranked) // 2 + 1]
    shown = {image.name: image for image in [*ranked[-1:], *middle]}
    return [
        picture for image in shown.values() for picture in _of_image(group, image, main, folder)
    ]


def _badness(image: RealImage, method: str) -> tuple[int, float]:
    row = image.rows[method]
    return len(row.flags), 0.0 if row.strict is None else -row.strict.overlap_f


def _of_image(group: str, image: RealImage, method: str, folder: Path) -> list[Picture]:
    """The labels over the image, which isn't ours to publish, and the predicted objects."""
    estimate, row = image.estimate, image.rows[method]
    assert estimate is not None
    colours = instance_colours(max([1, *(item.id for item in estimate.objects)]))
    views = beside(two_views(solid_of(estimate, colours), estimate), ["camera", "from behind"], 2)
    path = f"gallery/{group}_{image.name}.jpg"
    save_picture(views, folder / path)
    facts = [f"objects {row.objects}", f"obstacles {row.obstacles}", f"flagged {len(row.flags)}"]
    if row.strict is not None:
        facts += [f"labelled {row.true}", f"overlap F {100 * row.strict.overlap_f:.1f}"]
    caption = f"{image.name}: {', '.join(facts)}"
    return [*_masks(group, image, caption, folder), Picture(path, caption)]


def _masks(group: str, image: RealImage, caption: str, folder: Path) -> list[Picture]:
    assert image.estimate is not None
    assert image.frame is not None
    if image.estimate.masks is None:
        return []
    images = {"predicted": image.estimate.masks}
    if image.true is not None:
        images = {"labels": image.true, **images}
    tiles = [overlaid(image.frame.colour, labels)[::2, ::2] for labels in images.values()]
    path = f"gallery/{group}_{image.name}_masks.jpg"
    save_picture(beside(tiles, list(images)), folder / path)
    return [Picture(path, caption, shareable=False)]


SECTIONS: dict[type, Show] = {RealImageResult: real_image_sections}
