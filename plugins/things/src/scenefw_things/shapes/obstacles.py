"""What stands about and is no thing: tables, walls, shelves, crates, monitors, forearms."""

from __future__ import annotations

import numpy as np

from scenefw_things.shapes.family import family
from scenefw_things.shapes.solids import (
    Part,
    box,
    ellipsoid,
    moved,
    painted,
    rotation,
    rounded_box,
    tube,
)

Rng = np.random.Generator


@family(length=(0.5, 1.6), width=(0.4, 0.9), thickness=(0.015, 0.05), edge=(0.001, 0.01))
def table_top(
    rng: Rng, *, length: float, width: float, thickness: float, edge: float
) -> list[Part]:
    """A table's top; its legs are out of sight."""
    del rng
    return painted(0, rounded_box((length, width, thickness), edge))


@family(length=(1.0, 3.0), height=(0.4, 1.8), thickness=(0.02, 0.2), skirting=(0.0, 1.0))
def wall_panel(
    rng: Rng, *, length: float, height: float, thickness: float, skirting: float
) -> list[Part]:
    """A piece of wall, at times with a skirting board."""
    del rng
    parts = painted(0, box((length, thickness, height)))
    if skirting > 0.6:
        parts += painted(1, box((length, thickness + 0.03, 0.08), (0, 0, 0.04 - height / 2)))
    return parts


@family(
    length=(0.4, 1.0),
    depth=(0.15, 0.35),
    height=(0.3, 0.9),
    boards=(2, 4.99),
    thickness=(0.012, 0.03),
)
def shelf(
    rng: Rng, *, length: float, depth: float, height: float, boards: float, thickness: float
) -> list[Part]:
    """A shelf: two sides and boards, their number rounded down."""
    del rng
    sides = [box((thickness, depth, height), (s * (length - thickness) / 2, 0, 0)) for s in (-1, 1)]
    levels = np.linspace(-height / 2 + thickness, height / 2 - thickness, int(boards))
    floors = [box((length - 2 * thickness, depth, thickness), (0, 0, z)) for z in levels]
    return painted(0, sides, floors)


@family(length=(0.25, 0.6), width=(0.2, 0.4), height=(0.12, 0.35), slat=(0.3, 0.8))
def crate(rng: Rng, *, length: float, width: float, height: float, slat: float) -> list[Part]:
    """A crate of slats: four posts, three slats a side, a floor."""
    del rng
    t, x, y = 0.012, length / 2, width / 2
    posts = [
        box((2 * t, 2 * t, height), (i * (x - t), j * (y - t), 0)) for i in (-1, 1) for j in (-1, 1)
    ]
    tall = slat * height / 3
    slats = [box((length, t, tall), (0, j * (y + 0.4 * t), (k - 1) * height / 3))
             for k in range(3) for j in (-1, 1)]  # fmt: skip
    slats += [box((t, width, tall), (i * (x + 0.4 * t), 0, (k - 1) * height / 3))
              for k in range(3) for i in (-1, 1)]  # fmt: skip
    return painted(0, posts, slats, box((length, width, t), (0, 0, (t - height) / 2)))


@family(
    width=(0.35, 0.7), height=(0.22, 0.4), depth=(0.01, 0.05), stand=(0.06, 0.2), tilt=(-0.1, 0.25)
)
def monitor(
    rng: Rng, *, width: float, height: float, depth: float, stand: float, tilt: float
) -> list[Part]:
    """A monitor: screen, neck and foot."""
    del rng
    frame = rounded_box((width, depth, height), 0.005)
    glass = box((0.95 * width, 0.003, 0.93 * height), (0, -depth / 2, 0))
    screen = moved(
        painted(0, frame) + painted(1, glass), rotation(0, tilt), (0, 0, stand + height / 2)
    )
    neck = box((0.06, 0.02, stand + 0.3 * height), (0, depth, (stand + 0.3 * height) / 2))
    foot = rounded_box((0.4 * width, 0.18, 0.012), 0.004, (0, 0.03, 0.006))
    return screen + painted(0, neck, foot)


@family(
    length=(0.2, 0.45), girth=(0.025, 0.045), palm=(0.07, 0.1), curl=(0.1, 1.2), spread=(0.0, 0.25)
)
def forearm(
    rng: Rng, *, length: float, girth: float, palm: float, curl: float, spread: float
) -> list[Part]:
    """A forearm with a hand that points along x, its fingers curled by an angle (rad)."""
    sleeve = rng.random() < 0.5
    path = np.column_stack([np.linspace(-length, 0, 4), np.zeros(4), np.zeros(4)])
    arm = tube(path, girth * np.array([1.3, 1.2, 0.9, 0.7]), 0.85, sides=14)
    hand = ellipsoid((0.55 * palm, 0.48 * palm, 0.2 * palm), (0.45 * palm, 0, 0))
    fingers = []
    for number in range(4):
        side = (number - 1.5) * 0.22 * palm
        bend = curl * rng.uniform(0.7, 1.2)
        angles = np.array([0.0, 0.35, 0.8, 1.1]) * bend
        steps = (
            0.26
            * palm
            * np.column_stack(
                [np.cos(angles), spread * (number - 1.5) * np.ones(4), -np.sin(angles)]
            )
        )
        start = np.array([0.85 * palm, side, 0])
        fingers += tube(start + np.cumsum(steps, axis=0), 0.1 * palm, sides=8)
    thumb = np.array([[0.2, 0.4, 0], [0.5, 0.6, -0.1], [0.75, 0.62, -0.25]]) * palm
    fingers += tube(thumb, 0.11 * palm, sides=8)
    return painted(1 if sleeve else 0, arm) + painted(0, hand, fingers)
