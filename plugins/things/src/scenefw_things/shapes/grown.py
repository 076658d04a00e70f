"""What has grown or looks as if: fruit, toy animals, figures, shoes, balls."""

from __future__ import annotations

import numpy as np

from scenefw_things.shapes.family import family
from scenefw_things.shapes.solids import (
    Part,
    ellipsoid,
    lathe,
    moved,
    painted,
    prism,
    ring,
    rotation,
    tube,
)

Rng = np.random.Generator


@family(radius=(0.018, 0.06), height=(0.75, 1.35), stem=(0.0, 1.0))
def fruit(rng: Rng, *, radius: float, height: float, stem: float) -> list[Part]:
    """An apple, a lemon, an egg, an onion: a stretched ball, above the middle half with a stem."""
    turn = np.linspace(-np.pi / 2, np.pi / 2, 11)
    wide = np.cos(turn) * (1 + 0.12 * rng.uniform(-1, 1) * np.sin(turn))
    tall = radius * height
    profile = [
        (float(radius * w), float(tall * (1 + np.sin(t)))) for w, t in zip(wide, turn, strict=True)
    ]
    parts = painted(0, lathe(profile, 20))
    if stem > 0.5:
        path = np.array([[0, 0, 1.95], [0.02, 0, 2.1], [0.08, 0, 2.1 + 0.4 * (stem - 0.5)]]) * tall
        parts += painted(1, tube(path, 0.06 * radius, sides=6))
    return parts


@family(radius=(0.028, 0.042), height=(0.08, 0.12), neck=(0.4, 0.6))
def pear(rng: Rng, *, radius: float, height: float, neck: float) -> list[Part]:
    """A pear, standing: rings whose radius goes over from the belly to the neck."""
    del rng
    at = np.linspace(0, 1, 10)
    belly = np.sqrt(np.maximum(0, 1 - ((at - 0.32) / 0.34) ** 2))
    top = neck * np.sqrt(np.maximum(0, 1 - ((at - 0.72) / 0.29) ** 2))
    wide = radius * np.maximum(np.maximum(belly, top), 0.15)
    wide = np.convolve(np.pad(wide, 1, mode="edge"), [0.25, 0.5, 0.25], mode="valid")
    pieces = [
        lathe([(float(a), float(b)), (float(c), float(d))], 20)
        for a, b, c, d in zip(wide[:-1], at[:-1] * height, wide[1:], at[1:] * height, strict=True)
    ]
    path = np.array([[0, 0, 0.98], [0.03, 0, 1.08], [0.06, 0, 1.16]]) * height
    return painted(0, pieces) + painted(1, tube(path, 0.06 * radius, sides=6))


@family(radius=(0.018, 0.075))
def ball(rng: Rng, *, radius: float) -> list[Part]:
    """A ball."""
    del rng
    return painted(0, ellipsoid((radius,) * 3, (0, 0, radius), 24))


@family(length=(0.07, 0.18), girth=(0.22, 0.36), leg=(0.2, 0.55), legs=(0.07, 0.13),
        head=(0.6, 1.0), neck=(0.1, 1.2), tail=(0.0, 0.7))  # fmt: skip
def toy_animal(
    rng: Rng, *, length: float, girth: float, leg: float, legs: float, head: float, neck: float,
    tail: float,
) -> list[Part]:  # fmt: skip
    """A toy animal on four legs; all sizes but the length of its trunk are by that."""
    wide, tall, thick = girth * length, leg * length, legs * length
    middle = tall + 0.8 * wide
    trunk = ellipsoid((0.55 * length, 0.85 * wide, wide), (0, 0, middle))
    feet = [
        tube(np.array([[x, y, middle - 0.3 * wide], [x, y, 0.6 * thick]]), thick, sides=8)
        for x in (-0.33 * length, 0.33 * length)
        for y in (-0.5 * wide, 0.5 * wide)
    ]
    rise = neck * 0.5 * length
    skull = head * wide
    place = np.array([0.48 * length + 0.4 * skull, 0, middle + 0.3 * wide + rise])
    throat = tube(np.array([[0.33 * length, 0, middle + 0.2 * wide], place]), 0.5 * skull, sides=8)
    face = ellipsoid((skull, 0.75 * skull, 0.8 * skull), place)
    snout = ellipsoid(
        (0.6 * skull, 0.4 * skull, 0.35 * skull), place + (0.9 * skull, 0, -0.2 * skull)
    )
    ears = [
        ellipsoid(
            (0.15 * skull, 0.25 * skull, rng.uniform(0.3, 0.8) * skull),
            place + (-0.3 * skull, s * 0.55 * skull, 0.7 * skull),
            10,
        )
        for s in (-1, 1)
    ]
    parts = painted(0, trunk, *feet, throat, face) + painted(1, snout, ears)
    if tail > 0.1:
        back = np.array([-0.5 * length, 0, middle + 0.2 * wide])
        path = back + np.array([[0, 0, 0], [-0.4, 0, 0.15], [-0.7, 0, 0.5]]) * tail * length
        parts += painted(0, tube(path, 0.4 * thick, sides=6))
    return parts


@family(height=(0.08, 0.2), girth=(0.12, 0.2), head=(0.1, 0.17), arms=(0.035, 0.06))
def toy_figure(rng: Rng, *, height: float, girth: float, head: float, arms: float) -> list[Part]:
    """A doll: trunk, head, arms raised at random, legs; sizes by the height."""
    wide, skull, thick = girth * height, head * height, arms * height
    hip, shoulder = 0.42 * height, 0.74 * height
    trunk = lathe([(0.7 * wide, hip - 0.3 * wide), (0.85 * wide, hip), (wide, shoulder),
                   (0.5 * wide, shoulder + 0.4 * wide)], 16) * (0.7, 1, 1)  # fmt: skip
    ball_head = ellipsoid((skull,) * 3, (0, 0, height - skull))
    limbs = []
    for side in (-1, 1):
        top = np.array([0, side * 0.4 * wide, hip])
        limbs.append(tube(np.array([top, [0, side * 0.5 * wide, 0.6 * thick]]), thick, sides=8))
        raised = rng.uniform(-1.2, 1.2)
        start = np.array([0, side * 0.85 * wide, shoulder])
        reach = 0.3 * height * np.array([0.3, side * np.cos(raised), np.sin(raised)])
        limbs.append(
            tube(np.array([start, start + 0.5 * reach, start + reach]), 0.8 * thick, sides=8)
        )
    shoes = [
        ellipsoid((1.6 * thick, thick, 0.7 * thick), (0.7 * thick, s * 0.5 * wide, 0.7 * thick), 12)
        for s in (-1, 1)
    ]
    return painted(0, trunk) + painted(1, ball_head, *limbs) + painted(2, shoes)


@family(hollow=True, length=(0.16, 0.29), width=(0.3, 0.38), sole=(0.012, 0.03), height=(0.25, 0.5),
        toe=(0.5, 0.75))  # fmt: skip
def shoe(
    rng: Rng, *, length: float, width: float, sole: float, height: float, toe: float
) -> list[Part]:
    """A shoe: sole, toe cap, instep, and a collar that is open above; sizes by the length."""
    del rng
    wide, tall = width * length / 2, height * length
    x = np.array([-0.5, -0.44, -0.2, 0.12, 0.3, 0.42, 0.5, 0.42, 0.3, 0.12, -0.2, -0.44]) * length
    y = np.array([0, 0.6, 0.78, 0.85, 0.95, 0.7, 0.1, -0.6, -0.95, -0.95, -0.8, -0.6]) * wide
    outline = np.column_stack([x, y])
    base = prism(outline, 0, sole)
    cap_height = toe * tall * 0.6
    front = outline[outline[:, 0] > 0.05 * length]
    cap = np.concatenate(
        [
            prism(front * 0.96, sole, sole),
            np.column_stack([front * (0.85, 0.6), np.full(len(front), sole + 0.75 * cap_height)]),
            [[0.1 * length, s * 0.4 * wide, sole + cap_height] for s in (-1, 1)],
        ]
    )
    instep = np.array(
        [[0.12 * length, s * 0.85 * wide, sole] for s in (-1, 1)]
        + [[-0.08 * length, s * 0.8 * wide, sole] for s in (-1, 1)]
        + [[0.2 * length, s * 0.45 * wide, sole + 0.9 * cap_height] for s in (-1, 1)]
        + [[-0.02 * length, s * 0.5 * wide, 0.92 * tall] for s in (-1, 1)]
        + [[-0.09 * length, s * 0.5 * wide, 0.95 * tall] for s in (-1, 1)]
    )
    collar = ring([(0.8, sole), (0.97, sole), (0.85, tall), (0.72, tall)], 20)
    collar = [p * (0.22 * length, 0.8 * wide, 1) + (-0.25 * length, 0, 0) for p in collar]
    inner = lathe([(0.81, sole), (0.81, sole + 0.004)], 20)
    inner = inner * (0.22 * length, 0.8 * wide, 1) + (-0.25 * length, 0, 0)
    return painted(1, base) + painted(0, cap, instep, collar) + painted(2, inner)


@family(
    length=(0.06, 0.14), width=(0.35, 0.5), height=(0.3, 0.45), wheel=(0.2, 0.28), cabin=(0.4, 0.6)
)
def toy_car(
    rng: Rng, *, length: float, width: float, height: float, wheel: float, cabin: float
) -> list[Part]:
    """A toy car: body, cabin, four wheels; sizes by the length, the cabin's by the body's."""
    across, tall = width * length, height * length
    radius = wheel * length / 2
    low, waist = 0.5 * radius, radius + 0.4 * (tall - radius)
    half = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    body = prism(half * (length, across), low, waist, 0.96)
    shift = rng.uniform(-0.12, 0.05) * length
    top = prism(half * (cabin * length, 0.92 * across), waist, tall, 0.8) + (shift, 0, 0)
    tyre = painted(2, lathe([(radius, 0), (radius, 0.16 * across)], 16))
    wheels: list[Part] = []
    for x in (-0.3 * length, 0.3 * length):
        for y in (-0.42 * across, 0.58 * across):
            wheels += moved(tyre, rotation(0, np.pi / 2), (x, y, radius))
    return painted(0, body) + painted(1, top) + wheels
