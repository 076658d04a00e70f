"""Ranked grasps of one image: a table, and a picture with a mark for each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from scenefw.core.geometry import inverse, transform_points
from scenefw.core.types import Camera, Float32, Float64, SceneEstimate
from scenefw.report.palette import instance_colours
from scenefw.report.pictures import Picture, beside, font_of, legend, stacked
from scenefw.report.shading import draw, turned
from scenefw.report.solids import solid_of
from scenefw.report.surfaces import Surfaces
from scenefw.report.tables import Column, Table
from scenefw.report.window import by_label, cropped, vertices, window
from scenefw_grasping.grasps import RankedGrasp, Ranking

_SIZE = (520, 390)  # of a side: width, height (pixels)
_TURN = 150.0  # degrees
_SHAFT = 0.07  # m
_SCALE = 0.02  # m: a grasp that disturbs by this is drawn red
_GOOD, _BAD, _FAILED = (0, 140, 70), (215, 40, 30), (110, 110, 110)
_NUMBERED = 3
_NUMBER = 14.0  # pixels that a number takes
_STEPS = 12  # points of a line that are hidden or not
_HIDDEN = 0.01  # m behind a surface at which a point is hidden
_KEY = {
    word: tuple(part / 255 for part in colour)
    for word, colour in (
        ("moves no other object", _GOOD),
        (f"moves others by {100 * _SCALE:.0f} cm or more", _BAD),
        ("is not lifted", _FAILED),
    )
}


def grasp_table(ranking: Ranking, max_grasps: int = 10) -> Table:
    """The first grasps of a ranking, and how many there are."""
    columns = (
        Column("object", 0),
        Column("others move (mm)", 1),
        Column("lifted", 0),
        Column("taken", 0),
        Column("seal (%)", 0),
        Column("x, y, z (cm)", 0),
    )
    rows = []
    for number, entry in enumerate(ranking.grasps[:max_grasps], start=1):
        grasp = entry.grasp
        place = ", ".join(f"{100 * x:.1f}" for x in grasp.point)
        way = "outward, then up" if grasp.outward else "up"
        disturbance = 1000 * entry.lift.disturbance
        cells = (
            str(grasp.label),
            disturbance,
            entry.lift.failure or "yes",
            way,
            100 * grasp.seal,
            place,
        )
        rows.append((str(number), cells))
    count = f"{len(rows)} of {len(ranking.grasps)} grasps" if ranking.grasps else "no grasp"
    note = "; ".join(_without(ranking))
    return Table(f"Grasps by predicted disturbance, {count}", columns, tuple(rows), note=note)


def _without(ranking: Ranking) -> list[str]:
    """Why objects have no grasp: each reason once, with the objects that it holds for."""
    objects: dict[str, list[str]] = {}
    for label, why in ranking.left_out.items():
        objects.setdefault(why, []).append(str(label))
    return [
        f"object {labels[0]} has none: {why}"
        if len(labels) == 1
        else f"objects {', '.join(labels[:-1])} and {labels[-1]} have none: {why}"
        for why, labels in objects.items()
    ]


def draw_ranking(estimate: SceneEstimate, ranking: Ranking) -> Picture:
    """RGB (H, W, 3) in [0, 1]: the objects from two sides with a line for each grasp.

    Lines end at the contact. Green disturbs nothing, red moves the other objects by 2 cm or more,
    grey fails; the first grasps have their number. What an object hides from a side isn't drawn
    there.
    """
    colours = by_label(estimate, instance_colours(len(estimate.objects)))
    solid = solid_of(estimate, colours)
    surfaces = Surfaces({item.id: item.mesh for item in estimate.objects})
    camera = cropped(estimate.frame.camera, *window(estimate)).resized(*_SIZE)
    sides = (camera, turned(camera, vertices(estimate), _TURN))
    tiles = [
        mark_grasps(draw(solid, side), ranking, side, surfaces.seen_from(side)[0]) for side in sides
    ]
    sheet = beside(tiles, ["grasps, from the camera", "from behind"], columns=2)
    return stacked(sheet, legend(_KEY, sheet.shape[1]))


def mark_grasps(picture: Picture, ranking: Ranking, camera: Camera, depth: Float32) -> Picture:
    """The picture with a line for each grasp, without what lies behind something.

    Args:
        picture: RGB (H, W, 3) in [0, 1] of the objects.
        ranking: the best is drawn on top.
        camera: of the picture.
        depth: (H, W) of the objects and the floor, z in metres; 0 = nothing.
    """
    image = Image.fromarray(np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8))
    pen, labels = ImageDraw.Draw(image), list[tuple[int, tuple[int, int, int], float, float]]()
    for number in reversed(range(len(ranking.grasps))):
        entry, best = ranking.grasps[number], number < _NUMBERED
        steps = np.linspace(0, _SHAFT, _STEPS)[:, None]
        u, v, z = _pixels(entry.grasp.point + steps * entry.grasp.normal, camera).T
        visible = _in_front(u, v, z, depth)
        for i in np.flatnonzero(visible[:-1] & visible[1:]):
            ends = [(u[i], v[i]), (u[i + 1], v[i + 1])]
            pen.line(ends, fill=_colour(entry), width=4 if best else 2)
        if visible[0]:
            radius = 5 if best else 3
            box = [u[0] - radius, v[0] - radius, u[0] + radius, v[0] + radius]
            pen.ellipse(box, fill=_colour(entry))
        if best and visible.any():
            last = np.flatnonzero(visible)[-1]
            labels.append((number + 1, _colour(entry), u[last] + 3, v[last] - 18))
    _write_numbers(pen, labels)
    return np.asarray(image, dtype=np.float32) / np.float32(255)


def _write_numbers(
    pen: ImageDraw.ImageDraw, labels: list[tuple[int, tuple[int, int, int], float, float]]
) -> None:
    """Writes the numbers, each moved to the right until it covers none before it."""
    font, positions = font_of(15), list[tuple[float, float]]()
    for number, colour, x, y in reversed(labels):
        while any(abs(x - a) < _NUMBER and abs(y - b) < _NUMBER for a, b in positions):
            x += _NUMBER
        positions.append((x, y))
        pen.rectangle(pen.textbbox((x, y), str(number), font=font), fill=(255, 255, 255))
        pen.text((x, y), str(number), fill=colour, font=font)


def _in_front(u: Float64, v: Float64, z: Float64, depth: Float32) -> NDArray[np.bool_]:
    """Which points (N,) no surface of the picture hides; points beside the picture are shown."""
    height, width = depth.shape
    columns, rows = np.rint(u).astype(int), np.rint(v).astype(int)
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    before = depth[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)]
    return ~inside | (before == 0) | (z < before + _HIDDEN)


def _colour(entry: RankedGrasp) -> tuple[int, int, int]:
    if not entry.lift.lifted:
        return _FAILED
    share = min(1.0, entry.lift.disturbance / _SCALE)
    red, green, blue = (round(a + (b - a) * share) for a, b in zip(_GOOD, _BAD, strict=True))
    return red, green, blue


def _pixels(points: np.ndarray, camera: Camera) -> np.ndarray:
    local = transform_points(inverse(camera.T_world_camera), points)
    z = np.maximum(local[:, 2], 1e-3)
    u, v = local[:, 0] / z * camera.fx + camera.cx, local[:, 1] / z * camera.fy + camera.cy
    return np.stack([u, v, z], axis=1)
