"""Forms without a name: turned, blown, sawn from a board, bent, hinged, joined at an angle.

Their outlines are drawn, so that one family holds what many things have in common.
"""

from __future__ import annotations

import numpy as np

from scenefw.core.types import Float64
from scenefw_things.shapes.family import family
from scenefw_things.shapes.handled import LYING
from scenefw_things.shapes.solids import (
    Part,
    box,
    lathe,
    moved,
    painted,
    prism,
    rotation,
    rounded_box,
    tube,
    wall,
)

Rng = np.random.Generator
_MAX_TIGHTNESS = 0.7  # radius of a rod by that of its bends: at 1 its sections would cross


@family(hollow=True, height=(0.03, 0.24), radius=(0.025, 0.08), foot=(0.5, 1.1),
        belly=(-0.25, 0.5), thickness=(0.002, 0.006), oval=(0.6, 1.0), handles=(0.0, 2.99),
        spout=(0.0, 1.0))  # fmt: skip
def pot(
    rng: Rng, *, height: float, radius: float, foot: float, belly: float, thickness: float,
    oval: float, handles: float, spout: float,
) -> list[Part]:  # fmt: skip
    """A jug, a pitcher, a vase, a pot: an open vessel with up to two handles, perhaps a spout.

    Args:
        rng: draws the handles.
        height: of the vessel.
        radius: of its rim.
        foot: its radius by that of the rim.
        belly: how much wider the wall is half way up, by the radius.
        thickness: of the wall.
        oval: width by length of one with a spout; others are round.
        handles: their number, rounded down.
        spout: above 0.5 there is one, 6 cm long at 1.
    """
    at = np.linspace(0, 1, 6)
    wide = radius * (foot + (1 - foot) * at + belly * np.sin(np.pi * at))
    tall = at * height
    outer = list(zip(wide.tolist(), tall.tolist(), strict=True))
    inner, floor = wide[0] - thickness, min(1.5 * thickness, 0.15 * height)
    slope = (wide[1] - wide[0]) / tall[1]  # the floor follows the wall
    parts = painted(0, wall(outer, thickness), lathe([(inner, 0), (inner + slope * floor, floor)]))
    for side in (1, -1)[: int(handles)]:
        ends = np.sort(rng.uniform((0.1, 0.55), (0.45, 0.9)))
        grip = rng.uniform(0.003, 0.008)
        along = np.linspace(0, 1, 9)
        z = ends[0] + np.ptp(ends) * along
        start = np.interp(z, at, wide) - 0.6 * thickness
        out = wide.max() + rng.uniform(0.02, 0.04) - start
        path = np.column_stack([start + out * np.sin(np.pi * along) ** 0.6, 0 * z, z * height])
        parts += painted(1, tube(path * (side, 1, 1), grip, rng.uniform(0.7, 1.6)))
    if spout > 0.5:
        rim = wide[-1] - 0.5 * thickness
        turn = np.array([-0.35, 0.35])
        edge = np.column_stack([rim * np.sin(turn), rim * np.cos(turn), [height, height]])
        low = np.interp(0.75, at, wide) - 0.5 * thickness
        tip = [[0, wide[-1] + 0.06 * spout, height], [0, low, 0.75 * height]]
        parts += painted(0, np.concatenate([edge, tip]))
        return [Part(part.corners * (1, oval, 1), part.paint) for part in parts]
    return parts


@family(height=(0.03, 0.28), radius=(0.015, 0.055), steps=(2, 7.99), least=(0.25, 0.9),
        oval=(0.45, 1.0), sides=(0.0, 1.0))  # fmt: skip
def turned(
    rng: Rng, *, height: float, radius: float, steps: float, least: float, oval: float, sides: float
) -> list[Part]:
    """What a lathe makes, from a spool to a pawn, or a flat bottle of the same outline.

    Args:
        rng: draws heights and radii of the outline.
        height: of all.
        radius: of its widest place.
        steps: pieces of the outline, rounded down; each goes on where the last ended, or steps.
        least: smallest radius by the largest.
        oval: width by length; from 0.75 on it is round.
        sides: below 0.3 the outline has corners: 4 to 8 sides.
    """
    count = int(steps)
    edges = np.cumsum([0.0, *rng.uniform(0.3, 1.0, count)])
    edges *= height / edges[-1]
    radii = radius * rng.uniform(least, 1.0, (count, 2))
    radii[rng.integers(count), 0] = radius
    for i in range(1, count):
        if rng.random() < 0.7:
            radii[i, 0] = radii[i - 1, 1]
    corners = int(rng.integers(4, 9)) if sides < 0.3 else 24
    squash = (1, oval if oval < 0.75 else 1, 1)
    pieces = [
        lathe([(float(a), float(low)), (float(b), float(high))], corners) * squash
        for (a, b), low, high in zip(radii, edges[:-1], edges[1:], strict=True)
    ]
    first = int(rng.integers(1, count + 1))
    return painted(0, *pieces[:first]) + painted(1, *pieces[first:])


@family(size=(0.025, 0.13), corners=(3, 12.99), least=(0.35, 1.0), thickness=(0.004, 0.06),
        bore=(-0.6, 0.8), length=(0.4, 1.0))  # fmt: skip
def board(
    rng: Rng, *, size: float, corners: float, least: float, thickness: float, bore: float,
    length: float,
) -> list[Part]:  # fmt: skip
    """What is sawn from a board: any outline about its middle, perhaps with a hole of that form.

    Args:
        rng: draws the outline.
        size: its largest radius.
        corners: of the outline, rounded down.
        least: smallest radius by the largest.
        thickness: of the board.
        bore: size of the hole by that of the outline; below 0.2 there is none.
        length: of one side by the other.
    """
    count = int(corners)
    angle = 2 * np.pi * (np.arange(count) + rng.uniform(-0.25, 0.25, count)) / count
    radius = size * rng.uniform(least, 1.0, count)
    outline = radius[:, None] * np.column_stack([np.cos(angle), length * np.sin(angle)])
    inner = bore * outline if bore > 0.2 else np.zeros((count, 2))
    pieces = []
    for i in range(count):
        j = (i + 1) % count
        flat = np.array([outline[i], outline[j], inner[j], inner[i]])
        pieces.append(prism(flat if bore > 0.2 else flat[:3], 0, thickness))
    return painted(0, *pieces)


@family(slender=True, length=(0.08, 0.4), radius=(0.0025, 0.012), turn=(0.0, 4.5), waves=(0.0, 3.0),
        flatness=(0.4, 1.0), ends=(0.0, 1.0))  # fmt: skip
def bent_rod(
    rng: Rng, *, length: float, radius: float, turn: float, waves: float, flatness: float,
    ends: float,
) -> list[Part]:  # fmt: skip
    """A hook, a hanger, a cord, a handle: a rod that bends in its plane, perhaps with a head.

    Args:
        rng: draws where it bends.
        length: along it.
        radius: of its cross-section.
        turn: by which it bends from end to end (rad).
        waves: strength of bends to and fro.
        flatness: of its cross-section.
        ends: above 0.5 one end has a head, larger the larger.
    """
    along = np.linspace(0, 1, 17)
    centre = rng.uniform(0.2, 0.8)
    bend = turn / (1 + np.exp(-(along - centre) * rng.uniform(5, 25)))
    bend += waves * 0.5 * np.sin(2 * np.pi * (rng.uniform(0.5, 2) * along + rng.random()))
    tightest = np.abs(np.diff(bend)).max() * 16 * radius / length  # rod's by bend's radius
    bend *= min(1.0, _MAX_TIGHTNESS / max(tightest, 1e-9))
    steps = length / 16 * np.column_stack([np.cos(bend), np.sin(bend)])
    flat = np.concatenate([[[0, 0]], np.cumsum(steps[:-1], axis=0)])
    path = np.column_stack([flat, np.zeros(len(flat))])
    parts = painted(0, tube(path, radius, flatness))
    if ends > 0.5:
        head = radius * (1 + 4 * ends * rng.uniform(0.3, 1.0, 3))
        parts += painted(1, rounded_box(2 * head, 0.5 * radius, path[0]))
    return parts


@family(slender=True, jaw=(0.02, 0.12), grip=(0.06, 0.16), gap=(0.05, 0.6), bar=(0.004, 0.01),
        curve=(-0.5, 0.8), height=(0.3, 1.0))  # fmt: skip
def pincers(
    rng: Rng, *, jaw: float, grip: float, gap: float, bar: float, curve: float, height: float
) -> list[Part]:
    """Pliers, tongs, pincers, lying: two bars, one above the other, cross at a pivot.

    Args:
        rng: draws how much jaws are thinner.
        jaw: length before the pivot.
        grip: length behind it.
        gap: angle between the bars (rad).
        bar: half width of a bar.
        curve: by which grips bend outwards, by their length.
        height: of a bar by its width.
    """
    slim = rng.uniform(0.5, 1.0)
    parts: list[Part] = []
    for side in (-1, 1):
        along = np.linspace(1, 0, 6)
        bow = side * curve * 0.3 * grip * along**2
        behind = np.column_stack([-grip * along, bow, 0 * along])
        ahead = np.array([[0.5 * jaw, side * 0.3 * bar, 0], [jaw, 0, 0]])
        radii = bar * np.array([1, 1, 1, 1, 1, slim, slim, 0.5 * slim])
        half = painted(side > 0, tube(np.concatenate([behind, ahead]), radii, height))
        parts += moved(half, rotation(2, side * gap / 2), (0, 0, side * 1.02 * height * bar))
    pivot = lathe([(1.6 * bar, -1.7 * height * bar), (1.6 * bar, 1.7 * height * bar)], 12)
    return parts + painted(2, pivot)


@family(body=(0.06, 0.2), girth=(0.018, 0.04), grip=(0.06, 0.14), lean=(-0.4, 0.6),
        place=(0.1, 0.9), nose=(0.0, 1.0), foot=(0.0, 1.0))  # fmt: skip
def handled_body(
    rng: Rng, *, body: float, girth: float, grip: float, lean: float, place: float, nose: float,
    foot: float,
) -> list[Part]:  # fmt: skip
    """A body with a grip aside, lying: a dryer, a glue gun, a brush, an iron.

    Args:
        rng: draws which parts are round, and their sizes.
        body: its length.
        girth: its radius.
        grip: its length.
        lean: its angle (rad).
        place: where it sits along the body.
        nose: above 0.4 the body goes on narrower, longer the larger.
        foot: above 0.5 the grip ends in a foot, larger the larger.
    """
    if rng.random() < 0.6:
        ends = rng.uniform(0.6, 1.0, 2)
        trunk = lathe([(ends[0] * girth, 0), (girth, 0.25 * body), (girth, 0.7 * body),
                       (ends[1] * girth, body)], 16) @ LYING.T  # fmt: skip
    else:
        trunk = rounded_box((body, 2 * girth, rng.uniform(1.2, 2.2) * girth),
                            rng.uniform(0.1, 0.8) * girth, (body / 2, 0, 0))  # fmt: skip
    parts = painted(0, trunk)
    if nose > 0.4:
        thin, reach = rng.uniform(0.2, 0.6) * girth, 0.6 * nose * body
        snout = lathe([(thin, -0.1 * body), (rng.uniform(0.4, 1.0) * thin, reach)], 12)
        parts += moved(painted(1, snout), LYING, (body, 0, 0))
    thick = rng.uniform(0.7, 1.4) * girth
    hilt = painted(1, rounded_box((thick, 0.9 * thick, grip), 0.4 * thick, (0, 0, -grip / 2)))
    if foot > 0.5:
        base = rng.uniform(1.2, 2.5, 2) * thick
        hilt += painted(2, rounded_box((*base, foot * thick), 0.004, (0, 0, -grip)))
    parts += moved(hilt, rotation(1, lean), (place * body, 0, 0))
    return moved(parts, rotation(0, np.pi / 2))


@family(length=(0.04, 0.26), width=(0.35, 1.0), height=(0.12, 0.9), rounding=(0.02, 0.3),
        extras=(0, 6.99), extra=(0.1, 0.4))  # fmt: skip
def appliance(
    rng: Rng, *, length: float, width: float, height: float, rounding: float, extras: float,
    extra: float,
) -> list[Part]:  # fmt: skip
    """A box with knobs, lenses, feet and lids on its sides: a radio, a scale, a toaster.

    Args:
        rng: draws where these are, and of what form.
        length: of the box.
        width: by the length.
        height: by the length.
        rounding: of its edges, by its shortest side.
        extras: number of what it bears, rounded down.
        extra: their size by the length.
    """
    size = length * np.array([1.0, width, height])
    parts = painted(0, rounded_box(size, rounding * size.min()))
    for number in range(int(extras)):
        axis, sign = int(rng.integers(3)), rng.choice([-1.0, 1.0])
        across = np.minimum(extra * length * rng.uniform(0.3, 1.0, 3), 0.8 * size)
        rise = across[axis] * rng.uniform(0.1, 1.0)
        free = (size - across) / 2 * 0.8
        centre = rng.uniform(-1, 1, 3) * free
        centre[axis] = sign * size[axis] / 2
        across[axis] = 2 * rise
        parts += painted(1 + number % 2, _bump(rng, across, axis) + centre)
    return parts


def _bump(rng: Rng, size: Float64, axis: int) -> Float64:
    """A box, or a cylinder along an axis, about the origin."""
    if rng.random() < 0.5:
        return box(size)
    order = {0: LYING, 1: rotation(0, np.pi / 2), 2: np.eye(3)}[axis]
    radius = np.delete(size, axis).min() / 2
    return lathe([(radius, -size[axis] / 2), (radius, size[axis] / 2)], 16) @ order.T
