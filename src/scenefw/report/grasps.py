"""Ranked grasps of one image: a table, and a picture with a mark for each."""

from __future__ import annotations

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from scenefw.core.geometry import inverse, transform_points
from scenefw.core.grasps import RankedGrasp, Ranking
from scenefw.core.types import Camera, SceneEstimate
from scenefw.report.overview import by_label, cropped, vertices, window
from scenefw.report.palette import instance_colours
from scenefw.report.pictures import Picture, beside
from scenefw.report.shading import draw, turned
from scenefw.report.solids import solid_of
from scenefw.report.tables import Column, Table

_SIZE = (520, 390)  # of a side: width, height (pixels)
_TURN = 150.0  # degrees
_SHAFT = 0.07  # m
_SCALE = 0.02  # m: a grasp that disturbs by this is drawn red
_GOOD, _BAD, _FAILED = (0, 140, 70), (215, 40, 30), (110, 110, 110)
_NUMBERED = 3


def grasp_table(ranking: Ranking, most: int = 10) -> Table:
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
    for number, one in enumerate(ranking.grasps[:most], start=1):
        grasp = one.grasp
        place = ", ".join(f"{100 * x:.1f}" for x in grasp.point)
        way = "outward, then up" if grasp.outward else "up"
        moved = 1000 * one.lift.disturbance
        cells = (str(grasp.label), moved, one.lift.failure or "yes", way, 100 * grasp.seal, place)
        rows.append((str(number), cells))
    shown = f"{len(rows)} of {len(ranking.grasps)} grasps" if ranking.grasps else "no grasp"
    note = "; ".join(f"object {i} has none: {why}" for i, why in ranking.left_out.items())
    return Table(f"Grasps by predicted disturbance, {shown}", columns, tuple(rows), note=note)


def draw_ranking(estimate: SceneEstimate, ranking: Ranking) -> Picture:
    """RGB (H, W, 3) in [0, 1]: the objects from two sides with a line for each grasp.

    Lines end at the contact. Green disturbs nothing, red moves the other objects by 2 cm or more,
    grey fails; the first grasps have their number.
    """
    colours = by_label(estimate, instance_colours(len(estimate.objects)))
    solid = solid_of(estimate, colours)
    camera = cropped(estimate.frame.camera, *window(estimate)).resized(*_SIZE)
    sides = (camera, turned(camera, vertices(estimate), _TURN))
    tiles = [_marked(draw(solid, side), ranking, side) for side in sides]
    return beside(tiles, ["grasps, from the camera", "from behind"], columns=2)


def _marked(picture: Picture, ranking: Ranking, camera: Camera) -> Picture:
    image = Image.fromarray(np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8))
    pen, font = ImageDraw.Draw(image), ImageFont.load_default(16)
    for number in reversed(range(len(ranking.grasps))):  # the best on top
        one = ranking.grasps[number]
        ends = np.stack([one.grasp.point, one.grasp.point + _SHAFT * one.grasp.normal])
        (u, v, _), (far_u, far_v, _) = _pixels(ends, camera)
        best = number < _NUMBERED
        colour = _colour(one)
        pen.line([(u, v), (far_u, far_v)], fill=colour, width=4 if best else 2)
        radius = 5 if best else 3
        pen.ellipse([u - radius, v - radius, u + radius, v + radius], fill=colour)
        if best:
            box = pen.textbbox((far_u + 3, far_v - 18), str(number + 1), font=font)
            pen.rectangle(box, fill=(255, 255, 255))
            pen.text((far_u + 3, far_v - 18), str(number + 1), fill=colour, font=font)
    return np.asarray(image, dtype=np.float32) / np.float32(255)


def _colour(one: RankedGrasp) -> tuple[int, int, int]:
    if not one.lift.lifted:
        return _FAILED
    share = min(1.0, one.lift.disturbance / _SCALE)
    red, green, blue = (round(a + (b - a) * share) for a, b in zip(_GOOD, _BAD, strict=True))
    return red, green, blue


def _pixels(points: np.ndarray, camera: Camera) -> np.ndarray:
    local = transform_points(inverse(camera.T_world_camera), points)
    z = np.maximum(local[:, 2], 1e-3)
    u, v = local[:, 0] / z * camera.fx + camera.cx, local[:, 1] / z * camera.fy + camera.cy
    return np.stack([u, v, z], axis=1)
