"""What is mostly a box: packages, books, phones, computer mice, bricks, dice, keyboards' kin."""

from __future__ import annotations

import numpy as np

from scenefw_things.shapes.family import family
from scenefw_things.shapes.solids import (
    Part,
    below,
    box,
    ellipsoid,
    lathe,
    moved,
    painted,
    prism,
    ring,
    rotation,
    rounded_box,
)

Rng = np.random.Generator


@family(length=(0.04, 0.26), width=(0.03, 0.18), height=(0.015, 0.2), edge=(0.0005, 0.012))
def rounded_package(
    rng: Rng, *, length: float, width: float, height: float, edge: float
) -> list[Part]:
    """A box with rounded edges: a carton, a block, soap."""
    del rng
    return painted(0, rounded_box((length, width, height), edge, (0, 0, height / 2)))


@family(length=(0.13, 0.28), width=(0.5, 0.8), height=(0.008, 0.05), cover=(0.0008, 0.003),
        margin=(0.0, 0.004))  # fmt: skip
def book(
    rng: Rng, *, length: float, width: float, height: float, cover: float, margin: float
) -> list[Part]:
    """A book, lying: two covers, a spine, pages that may stand back; width by the length."""
    del rng
    across = width * length
    covers = [box((across, length, cover), (0, 0, z)) for z in (cover / 2, height - cover / 2)]
    spine = box((cover, length, height - 2 * cover), ((cover - across) / 2, 0, height / 2))
    pages = box((across - cover - margin, length - 2 * margin, height - 2 * cover),
                ((cover - margin) / 2, 0, height / 2))  # fmt: skip
    return painted(0, covers, spine) + painted(1, pages)


@family(length=(0.12, 0.17), width=(0.45, 0.55), height=(0.007, 0.011), corner=(0.004, 0.012),
        camera=(0.0, 0.003))  # fmt: skip
def phone(
    rng: Rng, *, length: float, width: float, height: float, corner: float, camera: float
) -> list[Part]:
    """A phone, lying on its screen or its back; width by the length."""
    across = width * length
    turn = np.linspace(0, np.pi / 2, 4)
    quarter = corner * np.column_stack([np.cos(turn), np.sin(turn)])
    half = np.array([across, length]) / 2 - corner
    outline = np.concatenate([(quarter + half) * (x, y) for x in (-1, 1) for y in (-1, 1)])
    thick, chamfer = height / 2, 0.0015
    middle = prism(outline, -thick + chamfer, thick - chamfer)
    small = outline * (1 - 2 * chamfer / across)
    body = np.concatenate([middle, prism(small, -thick, thick)])
    screen = prism(small * 0.97, -thick - 0.0002, -thick)
    parts = painted(0, body) + painted(1, screen)
    if camera > 0.001:
        place = (0.22 * across, 0.36 * length, thick + camera / 2)
        parts += painted(2, box((0.4 * across, 0.2 * length, camera), place))
        lens = lathe([(0.09 * across, 0), (0.08 * across, 0.001)], 12)
        parts += painted(1, lens + (place[0], place[1], thick + camera))
    if rng.random() < 0.5:
        return moved(parts, rotation(0, np.pi), (0, 0, thick + (camera + 0.001) * (camera > 0.001)))
    return moved(parts, shift=(0, 0, thick + 0.0002))


@family(length=(0.09, 0.125), width=(0.5, 0.65), height=(0.03, 0.042), lean=(-0.15, 0.15))
def computer_mouse(
    rng: Rng, *, length: float, width: float, height: float, lean: float
) -> list[Part]:
    """A computer mouse: half an ellipsoid, its sides cut, with a wheel."""
    del rng
    radii = np.array([length / 2, 0.56 * width * length, height])
    corners = ellipsoid(radii, sides=20)
    for normal, offset in (
        ((0, 0, -1), 0.0),
        ((0, 1, lean), 0.46 * width * length),
        ((0, -1, lean), 0.46 * width * length),
        ((lean, 0, 1), 0.94 * height),
    ):
        cut = below(corners, np.array(normal, float), offset)
        corners = corners if cut is None else cut
    wheel = moved(painted(1, lathe([(0.009, -0.003), (0.009, 0.003)], 14)), rotation(0, np.pi / 2),
                  (0.28 * length, 0, 0.83 * height - 0.007))  # fmt: skip
    return painted(0, corners) + wheel


@family(along=(1, 6.99), across=(1, 3.99), pitch=(0.008, 0.024), height=(0.9, 1.3))
def studded_brick(
    rng: Rng, *, along: float, across: float, pitch: float, height: float
) -> list[Part]:
    """A toy brick with studs; numbers of studs are rounded down, height by the pitch."""
    del rng
    columns, rows, tall = int(along), int(across), height * pitch
    body = box((columns * pitch, rows * pitch, tall), (0, 0, tall / 2))
    stud = lathe([(0.31 * pitch, tall), (0.31 * pitch, 1.22 * tall)], 14)
    places = [((i - (columns - 1) / 2) * pitch, (j - (rows - 1) / 2) * pitch, 0)
              for i in range(columns) for j in range(rows)]  # fmt: skip
    return painted(0, body, [stud + place for place in places])


@family(length=(0.12, 0.24), width=(0.04, 0.06), height=(0.015, 0.025), rows=(3, 8.99))
def remote_control(
    rng: Rng, *, length: float, width: float, height: float, rows: float
) -> list[Part]:
    """A remote control: a long body and rows of three keys, rounded down."""
    del rng
    body = rounded_box((length, width, height), 0.35 * height, (0, 0, height / 2))
    count, key = int(rows), 0.14 * width
    keys = [rounded_box((0.5 * length / count, 1.6 * key, 0.004), 0.001,
                        ((0.35 - 0.75 * i / count) * length, j * 0.27 * width, height))
            for i in range(count) for j in (-1, 0, 1)]  # fmt: skip
    return painted(0, body) + painted(1, keys)


@family(length=(0.06, 0.16), width=(0.04, 0.1), height=(0.03, 0.09), bore=(0.008, 0.02),
        lens=(0.0, 0.05))  # fmt: skip
def camera(
    rng: Rng, *, length: float, width: float, height: float, bore: float, lens: float
) -> list[Part]:
    """A camera: body, hump, lens with a rim, release."""
    del rng
    deep = 0.5 * width
    body = rounded_box((length, deep, height), 0.1 * deep, (0, 0, height / 2))
    hump = rounded_box((0.35 * length, 0.8 * deep, 0.3 * height), 0.004, (0, 0, height))
    radius = min(1.6 * bore, 0.42 * height)
    barrel = lathe([(radius, 0), (0.95 * radius, lens + 0.004)])
    rim = ring([(0.7 * radius, lens + 0.004), (0.95 * radius, lens + 0.004),
                (0.95 * radius, lens + 0.008), (0.7 * radius, lens + 0.008)])  # fmt: skip
    front = moved(painted(1, barrel, rim), rotation(0, np.pi / 2), (0, -deep / 2, 0.47 * height))
    release = lathe([(0.006, height), (0.006, height + 0.004)], 10) + (0.35 * length, 0, 0)
    return painted(0, body, hump) + front + painted(2, release)
