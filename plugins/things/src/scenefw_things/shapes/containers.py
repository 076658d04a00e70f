"""What holds something: cans, bottles, cups, bowls, plates, trays, pans."""

from __future__ import annotations

import numpy as np

from scenefw_things.shapes.family import family
from scenefw_things.shapes.solids import (
    SIDES,
    Part,
    arc,
    box,
    circle,
    lathe,
    moved,
    painted,
    prism,
    ring,
    rounded_box,
    tube,
    wall,
)

Rng = np.random.Generator
Profile = list[tuple[float, float]]


@family(height=(0.05, 0.18), radius=(0.025, 0.055), rim=(0.0015, 0.004))
def can(rng: Rng, *, height: float, radius: float, rim: float) -> list[Part]:
    """A can: a label between two rims, the lid a little below the upper one."""
    del rng
    inner = radius - rim
    body = lathe(
        [(inner, rim), (radius, 2 * rim), (radius, height - 2 * rim), (inner, height - rim)]
    )
    foot = lathe([(inner, 0), (inner, rim)])
    lip = ring([(inner - rim, height - rim), (inner, height - rim), (inner, height),
                (inner - rim, height)])  # fmt: skip
    return painted(0, body) + painted(1, foot, lip)


@family(height=(0.14, 0.33), radius=(0.028, 0.05), shoulder=(0.55, 0.75), neck=(0.28, 0.5),
        bulge=(0.0, 1.0), cap=(0.016, 0.035))  # fmt: skip
def bottle(
    rng: Rng,
    *,
    height: float,
    radius: float,
    shoulder: float,
    neck: float,
    bulge: float,
    cap: float,
) -> list[Part]:
    """A bottle: body, shoulder, neck and cap; of glass, of a drink, of shampoo.

    Args:
        rng: not used.
        height: of all.
        radius: of the body.
        shoulder: where it begins, by the height.
        neck: its radius by that of the body.
        bulge: how round the shoulder is.
        cap: its height.
    """
    del rng
    low, narrow = shoulder * height, neck * radius
    top = height - cap
    high = low + (top - low) * 0.6
    middle = narrow + (radius - narrow) * (0.5 + 0.35 * bulge)
    edge = 0.1 * radius
    body = lathe([(radius - edge, 0), (radius, edge), (radius, low)])
    slope = [lathe([(radius, low), (middle, (low + high) / 2)]),
             lathe([(middle, (low + high) / 2), (narrow, high)])]  # fmt: skip
    throat = lathe([(narrow, high), (narrow, top)])
    lid = lathe([(1.15 * narrow, top), (1.15 * narrow, height - 0.001), (1.05 * narrow, height)])
    return painted(0, body) + painted(1, slope, throat) + painted(2, lid)


@family(height=(0.06, 0.16), radius=(0.035, 0.055), waist=(0.6, 0.85), lid=(0.008, 0.025))
def jar(rng: Rng, *, height: float, radius: float, waist: float, lid: float) -> list[Part]:
    """A jar with a lid, its neck narrower than both."""
    del rng
    top = height - lid
    glass = lathe([(0.9 * radius, 0), (radius, 0.1 * radius), (radius, 0.85 * top),
                   (waist * radius, top)])  # fmt: skip
    cover = lathe(
        [(min(1.08 * waist, 0.98) * radius, top), (min(1.08 * waist, 0.98) * radius, height)]
    )
    return painted(0, glass) + painted(1, cover)


def _vessel(height: float, base: float, rim: float, thickness: float, curve: float) -> list[Part]:
    """A round open vessel whose wall widens; `curve` bends it outwards."""
    at = np.array([0.0, 0.33, 0.67, 1.0])
    radius = base + (rim - base) * (at + curve * at * (1 - at))
    outer: Profile = list(zip(radius.tolist(), (at * height).tolist(), strict=True))
    floor = min(1.5 * thickness, 0.3 * height)
    inner = base - thickness
    slope = (radius[1] - radius[0]) / (at[1] * height)  # the floor follows the wall
    disc = lathe([(inner, 0), (inner + slope * floor, floor)])
    return painted(0, wall(outer, thickness), disc)


@family(hollow=True, height=(0.07, 0.14), base=(0.025, 0.035), widening=(1.0, 1.45),
        thickness=(0.002, 0.004))  # fmt: skip
def cup(rng: Rng, *, height: float, base: float, widening: float, thickness: float) -> list[Part]:
    """A beaker without a handle."""
    del rng
    return _vessel(height, base, base * widening, thickness, 0.0)


@family(hollow=True, height=(0.075, 0.12), base=(0.032, 0.045), widening=(0.95, 1.2),
        thickness=(0.003, 0.005), reach=(0.022, 0.035), grip=(0.004, 0.007))  # fmt: skip
def mug(
    rng: Rng, *, height: float, base: float, widening: float, thickness: float, reach: float,
    grip: float,
) -> list[Part]:  # fmt: skip
    """A mug: a cup with a handle, whose reach and half thickness are given."""
    del rng
    cup_parts = _vessel(height, base, base * widening, thickness, 0.0)
    side = base * (1 + widening) / 2 - 0.6 * thickness
    stretch = 0.33 * height / reach
    path = arc((side, 0, 0.5 * height), reach, -np.pi / 2, np.pi / 2, 9, stretch)
    path[[0, -1], 0] -= 0.2 * thickness
    return cup_parts + painted(1, tube(path, grip, flatness=1.2))


@family(hollow=True, height=(0.04, 0.09), radius=(0.055, 0.12), foot=(0.35, 0.6),
        thickness=(0.003, 0.006), curve=(0.2, 0.7))  # fmt: skip
def bowl(
    rng: Rng, *, height: float, radius: float, foot: float, thickness: float, curve: float
) -> list[Part]:
    """A bowl; its foot's radius by that of the rim."""
    del rng
    return _vessel(height, foot * radius, radius, thickness, curve)


@family(hollow=True, radius=(0.07, 0.14), height=(0.012, 0.03), flat=(0.55, 0.75),
        thickness=(0.003, 0.006))  # fmt: skip
def plate(rng: Rng, *, radius: float, height: float, flat: float, thickness: float) -> list[Part]:
    """A plate: a disc and a rim that rises."""
    del rng
    inner = flat * radius
    rim = ring([(inner, 0), (radius, height - 0.5 * thickness), (radius, height),
                (inner, thickness)])  # fmt: skip
    return painted(0, lathe([(inner, 0), (inner, thickness)]), rim)


@family(hollow=True, length=(0.2, 0.42), width=(0.14, 0.3), height=(0.015, 0.07),
        thickness=(0.003, 0.006), slope=(0.0, 0.5))  # fmt: skip
def tray(
    rng: Rng, *, length: float, width: float, height: float, thickness: float, slope: float
) -> list[Part]:
    """A tray or a shallow bin: a floor and four walls that lean outwards."""
    del rng
    half = np.array([length, width]) / 2
    out = half + slope * height
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    rings = [
        corners * half,
        corners * out,
        corners * (out - thickness),
        corners * (half - thickness),
    ]
    heights = (0.0, height, height, 0.0)
    columns = np.stack([np.column_stack([xy, np.full(4, z)])
                        for xy, z in zip(rings, heights, strict=True)], axis=1)  # fmt: skip
    walls = [np.concatenate([columns[i], columns[(i + 1) % 4]]) for i in range(4)]
    inner = half - thickness
    grown = (inner + slope * thickness) / inner  # the floor follows the walls
    floor = prism(corners * inner, 0, thickness)
    floor[4:, :2] *= grown
    return painted(0, walls, floor)


@family(hollow=True, radius=(0.07, 0.13), height=(0.035, 0.07), thickness=(0.002, 0.004),
        widening=(1.0, 1.2), handle=(0.13, 0.2), grip=(0.008, 0.013), rise=(0.0, 0.3))  # fmt: skip
def pan(
    rng: Rng, *, radius: float, height: float, thickness: float, widening: float, handle: float,
    grip: float, rise: float,
) -> list[Part]:  # fmt: skip
    """A pan with a long handle that rises."""
    del rng
    dish = _vessel(height, radius / widening, radius, thickness, 0.0)
    narrow = radius - 0.2 * (radius - radius / widening)  # of the wall, where the handle begins
    start = narrow - 0.5 * thickness + 0.42 * grip  # its rounded end reaches 0.42 farther
    along = np.linspace(0, 1, 4)
    path = np.column_stack([start + along * handle, 0 * along,
                            0.8 * height + rise * handle * along])  # fmt: skip
    bar = tube(path, np.array([0.7, 0.8, 1.0, 1.0]) * grip, flatness=0.7)
    return dish + painted(1, bar)


@family(height=(0.12, 0.22), foot=(0.028, 0.04), bowl_height=(0.35, 0.55), belly=(0.03, 0.045),
        stem=(0.0035, 0.006))  # fmt: skip
def wine_glass(
    rng: Rng, *, height: float, foot: float, bowl_height: float, belly: float, stem: float
) -> list[Part]:
    """A glass on a stem; the height of its bowl by that of all."""
    del rng
    low, thickness = (1 - bowl_height) * height, 0.0022
    deep = height - low
    base = lathe([(foot, 0), (foot, 0.002), (stem, 0.006)])
    rod = lathe([(stem, 0.006), (stem, low)])
    closed = [lathe([(stem, low), (0.75 * belly, low + 0.12 * deep)])]
    outer: Profile = [(0.75 * belly, low + 0.12 * deep), (belly, low + 0.4 * deep),
                      (0.8 * belly, height)]  # fmt: skip
    return painted(0, base, rod, closed, wall(outer, thickness))


@family(hollow=True, length=(0.1, 0.3), width=(0.08, 0.22), height=(0.06, 0.16),
        thickness=(0.003, 0.008))  # fmt: skip
def open_box(
    rng: Rng, *, length: float, width: float, height: float, thickness: float
) -> list[Part]:
    """A carton without a lid, or a bin."""
    del rng
    x, y, t = length / 2, width / 2, thickness
    sides = [box((t, width, height), (s * (x - t / 2), 0, height / 2)) for s in (-1, 1)]
    sides += [box((length - 2 * t, t, height), (0, s * (y - t / 2), height / 2)) for s in (-1, 1)]
    return painted(0, sides, box((length - 2 * t, width - 2 * t, t), (0, 0, t / 2)))


@family(height=(0.1, 0.22), radius=(0.028, 0.045), flatness=(0.55, 1.0), head=(0.045, 0.07),
        neck=(0.3, 0.45))  # fmt: skip
def spray_bottle(
    rng: Rng, *, height: float, radius: float, flatness: float, head: float, neck: float
) -> list[Part]:
    """A bottle with a spray head: nozzle, trigger, and a body that may be flat."""
    del rng
    squash = np.array([1.0, flatness, 1.0])
    tall = 0.72 * height
    body = lathe([(0.94 * radius, 0), (radius, 0.06 * radius), (radius, 0.8 * tall)]) * squash
    top = lathe([(radius, 0.8 * tall), (neck * radius, tall)]) * squash
    throat = lathe([(neck * radius, tall), (neck * radius, 0.86 * height)], sides=16) * squash
    width = 0.28 * head
    hood = rounded_box((head, width, 0.14 * height), 0.004, (0.2 * head, 0, 0.93 * height))
    nozzle = box((0.1 * head, 0.4 * width, 0.05 * height), (0.74 * head, 0, 0.94 * height))
    trigger = tube(
        np.array([[0.5, 0, 0.89], [0.62, 0, 0.8], [0.6, 0, 0.7]]) * (head, 1, height), 0.1 * head,
        sides=8,
    )  # fmt: skip
    return painted(0, body, top) + painted(1, throat, hood, trigger) + painted(2, nozzle)


@family(slender=True, length=(0.1, 0.2), radius=(0.014, 0.025), cap=(0.012, 0.03))
def tube_of_paste(rng: Rng, *, length: float, radius: float, cap: float) -> list[Part]:
    """A tube of paste: round at the cap, flat at the end, lying."""
    del rng
    shape = np.column_stack([np.full(SIDES, 0.0), *(circle(radius).T)])
    end = np.array([[length, s * 1.45 * radius, t] for s in (-1, 1) for t in (-0.001, 0.001)])
    lid = np.concatenate([np.column_stack([np.full(16, x), *(circle(0.6 * radius, 16).T)])
                          for x in (-cap, 0.0)])  # fmt: skip
    parts = painted(0, np.concatenate([shape, end])) + painted(1, lid)
    return moved(parts, shift=(0, 0, radius))


@family(radius=(0.02, 0.06), width=(0.012, 0.05), bore=(0.5, 0.8))
def tape_roll(rng: Rng, *, radius: float, width: float, bore: float) -> list[Part]:
    """A roll of tape: a ring on its side, with a core."""
    del rng
    hole, core = bore * radius, bore * radius + 0.15 * (1 - bore) * radius
    outside = ring([(core, 0), (radius, 0), (radius, width), (core, width)])
    inside = ring([(hole, 0), (core, 0), (core, width), (hole, width)])
    return painted(0, outside) + painted(1, inside)
