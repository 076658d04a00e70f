"""Labels that people paint on a height map's picture, and views labelled by them (thesis 4.5.3)."""

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from scipy.ndimage import maximum_filter, minimum_filter

from scenefw.core.errors import ConfigError, InputError, StorageError
from scenefw.core.files import replacing, unreadable, utf8_text, write_text
from scenefw.core.height_maps import HeightMap
from scenefw.core.labels import UNKNOWN
from scenefw.core.types import Camera, Frame
from scenefw.data.files.pictures import DAMAGED_PICTURE
from scenefw.data.files.sequences import write_sequence
from scenefw_painting.height_map import view

# Colours that pictures of tables rarely hold, told apart by people with any colour vision.
_COLOURS = (
    (0, 255, 255), (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 0), (255, 0, 255),
    (255, 128, 0), (128, 0, 255), (0, 128, 255), (128, 255, 0), (255, 0, 128), (0, 255, 128),
)  # fmt: skip
_LISTED = 5
_TOLERANCE = 0.02  # m
_LEAST_AGREEMENT = 0.02  # share of a view's pixels; cameras look past the map, too
_SWATCH = (240, 28)


def palette(classes: Sequence[str]) -> NDArray[np.uint8]:
    """The colour (C, 3) that stands for each class.

    Raises:
        ConfigError: more classes than colours.
    """
    if len(classes) > len(_COLOURS):
        raise ConfigError(f"{len(classes)} classes to paint, at most {len(_COLOURS)} have a colour")
    return np.array(_COLOURS[: len(classes)], dtype=np.uint8).reshape(-1, 3)


def export_painting(folder: Path | str, height_map: HeightMap, classes: Sequence[str]) -> Path:
    """Writes colours.png to paint on, and the palette as palette.png and palette.json.

    Returns the picture. It has one pixel per vertex; paint it with the palette's exact colours, no
    soft brush, and save it as PNG. A picture that was painted on is never replaced.

    Raises:
        ConfigError: more classes than colours.
        StorageError: the folder can't be written, or another picture of that name is there.
    """
    folder, colours = Path(folder), palette(classes)
    picture, canvas = folder / "colours.png", _canvas(height_map, colours)
    if picture.exists() and not _shows(picture, canvas):
        raise StorageError(
            f"{picture} was painted on, or shows another map, and would be lost; give another "
            "folder, or move it away"
        )
    with replacing(picture) as temporary:
        Image.fromarray(canvas).save(temporary)
    names = {name: colour.tolist() for name, colour in zip(classes, colours, strict=True)}
    write_text(folder / "palette.json", json.dumps(names, indent=1) + "\n")
    with replacing(folder / "palette.png") as temporary:
        _swatches(classes, colours).save(temporary)
    return picture


def load_painting(
    path: Path | str,
    height_map: HeightMap,
    classes: Sequence[str] | None = None,
    background: str | None = None,
) -> HeightMap:
    """The map with labels painted by hand: a palette colour is its class.

    Args:
        path: the painted picture.
        height_map: the map whose picture was exported.
        classes: names by id; None = those of palette.json beside the picture.
        background: class of vertices that were left as they were; None = unknown.

    Raises:
        InputError: a picture of another size, or with colours that are neither in the palette nor
            the map's own: they are listed with their counts.
    """
    path = Path(path)
    classes = _classes(path) if classes is None else tuple(classes)
    if background is not None and background not in classes:
        raise InputError(f"background '{background}' is not a class; choose one of {list(classes)}")
    painted, colours = _picture(path, height_map), palette(classes)
    labels = np.full(height_map.grid.shape, UNKNOWN, np.int32)
    untouched = (painted == _canvas(height_map, colours)).all(-1)
    valid = untouched.copy()
    for index, colour in enumerate(colours):
        match = (painted == colour).all(-1)
        labels[match] = index
        valid |= match
    if not valid.all():
        raise _unknown_colours(path, painted[~valid], classes, colours)
    if background is not None:
        labels[untouched] = classes.index(background)
    labels[~height_map.seen] = UNKNOWN
    return replace(
        height_map,
        labels=labels,
        probabilities=_one_hot(labels, len(classes)),
        sources=None,
        classes=tuple(classes),
    )


def write_views(
    folder: Path | str,
    height_map: HeightMap,
    views: Iterable[Frame | Camera],
    border: int = 2,
    tolerance: float = _TOLERANCE,
) -> Path:
    """Projects a map's labels into views and writes them as a folder that `RGBDFolder` reads.

    Args:
        folder: where to.
        height_map: with labels.
        views: key-frames, whose colour and depth are kept, or cameras, which see the map's own.
        border: pixels on either side of a border between labels that become unknown.
        tolerance: pixels of a key-frame whose depth differs from the map's by more (m) are unknown.

    Raises:
        InputError: the map has no labels, or there is no view.
    """
    if height_map.labels is None:
        raise InputError("the height map has no labels; load_painting adds them")
    frames = _labelled(height_map, views, border, tolerance)
    return write_sequence(folder, frames, height_map.classes, ordered=False)


def require_agreement(
    height_map: HeightMap,
    views: Iterable[Frame],
    name: str,
    tolerance: float = _TOLERANCE,
) -> None:
    """Finds out before views are labelled whether they see the map where it is.

    Args:
        height_map: any.
        views: some of them, with measurements.
        name: where they come from.
        tolerance: pixels whose depth differs from the map's by more (m) don't see it.

    Raises:
        InputError: hardly any pixel sees the map.
    """
    shares = [_agrees(frame, view(height_map, frame.camera), tolerance).mean() for frame in views]
    if not shares or np.mean(shares) < _LEAST_AGREEMENT:
        finding = (
            f"see the map in {np.mean(shares):.1%} of their pixels" if shares else "have no pose"
        )
        raise InputError(
            f"views of {name} {finding}; give the recording that the map was made of (maps of "
            "earlier versions don't store its world: make a new one with run=label)"
        )


def _agrees(frame: Frame, rendering: Frame, tolerance: float) -> NDArray[np.bool_]:
    """Pixels (H, W) of a frame whose depth is that of the map as its camera sees it."""
    measured = (frame.depth > 0) & (rendering.depth > 0)
    return np.asarray(measured & (np.abs(frame.depth - rendering.depth) <= tolerance))


def _labelled(
    height_map: HeightMap, views: Iterable[Frame | Camera], border: int, tolerance: float
) -> Iterator[Frame]:
    for viewpoint in views:
        camera = viewpoint if isinstance(viewpoint, Camera) else viewpoint.camera
        rendering = view(height_map, camera)
        if rendering.labels is None:
            continue
        labels = without_borders(rendering.labels, border)
        if isinstance(viewpoint, Camera):
            yield replace(rendering, labels=labels)
        else:
            agrees = _agrees(viewpoint, rendering, tolerance)
            yield replace(viewpoint, labels=np.where(agrees, labels, UNKNOWN).astype(np.int32))


def without_borders(labels: NDArray[np.int32], border: int) -> NDArray[np.int32]:
    """Labels (H, W) with unknown pixels within `border` of another label."""
    if border <= 0:
        return labels
    size = 2 * border + 1
    mixed = minimum_filter(labels, size) != maximum_filter(labels, size)
    return np.where(mixed, UNKNOWN, labels).astype(np.int32)


def _canvas(height_map: HeightMap, colours: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The map's picture to paint on, in which no pixel has exactly the colour of a class.

    Whoever reads the painting takes pixels of such a colour for painted ones. So where the map
    itself has it, each channel is changed by 1 of 255, which nobody sees.
    """
    canvas = height_map.colour.copy()
    for colour in colours:
        match = (canvas == colour).all(-1)
        canvas[match] = np.where(colour > 127, colour - 1, colour + 1)
    return canvas


def _shows(path: Path, canvas: NDArray[np.uint8]) -> bool:
    try:
        with Image.open(path) as image:
            return np.array_equal(np.array(image), canvas)
    except DAMAGED_PICTURE:
        return False


def _picture(path: Path, height_map: HeightMap) -> NDArray[np.uint8]:
    try:
        with Image.open(path) as image:
            painted = np.array(image.convert("RGB"))
    except DAMAGED_PICTURE as error:
        reason = unreadable(error, "give a PNG picture")
        raise InputError(f"cannot read painting {path}: {reason}") from error
    if painted.shape[:2] != height_map.grid.shape:
        rows, columns = painted.shape[:2]
        n = height_map.grid.vertices
        raise InputError(
            f"painting {path} is {columns} x {rows} pixels, its height map {n} x {n}; paint on the "
            "exported picture without resizing it"
        )
    return painted


def _classes(path: Path) -> tuple[str, ...]:
    file = path.with_name("palette.json")
    try:
        names = json.loads(utf8_text(file))
    except (OSError, ValueError) as error:
        raise InputError(
            f"cannot read {file}: {unreadable(error)}; leave the exported palette.json beside the "
            "painting"
        ) from error
    return tuple(names)


def _unknown_colours(
    path: Path, pixels: NDArray[np.uint8], classes: Sequence[str], colours: NDArray[np.uint8]
) -> InputError:
    values, counts = np.unique(pixels, axis=0, return_counts=True)
    order = np.argsort(-counts, kind="stable")
    listed = ", ".join(f"{tuple(values[i].tolist())}: {counts[i]}" for i in order[:_LISTED])
    more = f" and {len(values) - _LISTED} more" if len(values) > _LISTED else ""
    choices = ", ".join(
        f"{name} {tuple(colour.tolist())}" for name, colour in zip(classes, colours, strict=True)
    )
    return InputError(
        f"painting {path} has {len(pixels)} pixels of {len(values)} unknown colour(s) ({listed}"
        f"{more}); paint with the palette's exact colours, no soft brush: {choices}"
    )


def _one_hot(labels: NDArray[np.int32], classes: int) -> NDArray[np.float32]:
    """(C, V, V), uniform where the label is unknown."""
    ids = np.arange(classes)[:, None, None]
    return np.where(labels == UNKNOWN, 1 / classes, labels == ids).astype(np.float32)


def _swatches(classes: Sequence[str], colours: NDArray[np.uint8]) -> Image.Image:
    width, height = _SWATCH
    image = Image.new("RGB", (width, height * max(len(classes), 1)), "white")
    draw = ImageDraw.Draw(image)
    for i, (name, colour) in enumerate(zip(classes, colours, strict=True)):
        draw.rectangle(
            (0, i * height, height * 2, (i + 1) * height - 1), fill=tuple(colour.tolist())
        )
        draw.text((height * 2 + 8, i * height + 8), name, fill="black")
    return image
