"""What is taken by the hand: tools, cutlery, pens, drills, clamps, torches."""

from __future__ import annotations

import numpy as np

from scenefw_things.shapes.family import family
from scenefw_things.shapes.solids import (
    Part,
    arc,
    box,
    lathe,
    moved,
    painted,
    prism,
    ring,
    rotation,
    rounded_box,
    tube,
)

Rng = np.random.Generator
LYING = rotation(1, np.pi / 2)
"""Turns what is made along z so that it lies along x."""


def _rod(length: float, radius: float, start: float = 0.0, sides: int = 12) -> np.ndarray:
    """A straight rod along z."""
    return lathe([(radius, start), (radius, start + length)], sides)


@family(slender=True, length=(0.2, 0.34), grip=(0.01, 0.016), head=(0.07, 0.13), face=(0.01, 0.017))
def hammer(rng: Rng, *, length: float, grip: float, head: float, face: float) -> list[Part]:
    """A hammer, lying: handle, head with a face and a claw."""
    del rng
    handle = lathe([(grip, 0), (1.1 * grip, 0.2 * length), (0.75 * grip, length)], 12)
    block = box((0.5 * head, 1.6 * face, 1.6 * face), (0, 0, length))
    front = moved(painted(1, _rod(0.3 * head, face)), LYING, (0.2 * head, 0, length))
    claw = prism(np.array([[0, -face], [0, face], [-0.35 * head, 0.9 * face],
                           [-0.35 * head, -0.9 * face]]), -0.5 * face, 0.5 * face)  # fmt: skip
    back = moved(painted(1, claw), rotation(1, -0.35), (-0.22 * head, 0, length))
    parts = painted(0, handle) + painted(1, block) + front + back
    return moved(parts, LYING @ rotation(2, np.pi / 2), (0, 0, 1.1 * face))


@family(slender=True, length=(0.14, 0.26), grip=(0.011, 0.018), handle=(0.35, 0.5),
        shaft=(0.0025, 0.004))  # fmt: skip
def screwdriver(rng: Rng, *, length: float, grip: float, handle: float, shaft: float) -> list[Part]:
    """A screwdriver, lying; the length of its handle by that of all."""
    del rng
    end = handle * length
    hilt = lathe([(0.75 * grip, 0), (grip, 0.15 * end), (grip, 0.75 * end), (0.55 * grip, end)], 8)
    rod = _rod(0.9 * length - end, shaft, end)
    tip = np.concatenate([lathe([(shaft, 0.9 * length)], 12),
                          box((3 * shaft, 0.001, 0.001), (0, 0, length))])  # fmt: skip
    return moved(painted(0, hilt) + painted(1, rod, tip), LYING, (0, 0, grip))


@family(slender=True, length=(0.13, 0.3), bowl=(0.016, 0.035), grip=(0.0025, 0.006),
        bend=(0.005, 0.02))  # fmt: skip
def spoon(rng: Rng, *, length: float, bowl: float, grip: float, bend: float) -> list[Part]:
    """A spoon, lying: a dish of three rings and a bent handle."""
    del rng
    stretch, thin = np.array([1.4, 1.0, 1.0]), 0.0015
    deep = 0.35 * bowl
    dish = ring([(0.6 * bowl, 0), (bowl, deep), (bowl - thin, deep), (0.6 * bowl - thin, thin),
                 (0.6 * bowl - thin, 0)], 16)  # fmt: skip
    base = lathe([(0.6 * bowl - thin, 0), (0.6 * bowl - thin, thin)], 16)
    along = np.linspace(0, 1, 6)
    start = 1.38 * bowl
    path = np.column_stack([start + along * (length - 2 * start), 0 * along,
                            deep - thin + bend * np.sin(np.pi * along)])  # fmt: skip
    handle = tube(path, grip * (0.8 + 0.5 * along), flatness=0.5, sides=8)
    return painted(0, [piece * stretch for piece in (*dish, base)]) + painted(1, handle)


@family(
    slender=True, length=(0.24, 0.36), blade=(0.06, 0.1), width=(0.05, 0.08), grip=(0.006, 0.011)
)
def spatula(rng: Rng, *, length: float, blade: float, width: float, grip: float) -> list[Part]:
    """A spatula, lying: a flat blade and a handle that rises."""
    del rng
    flat = rounded_box((blade, width, 0.003), 0.001, (0, 0, 0.0015))
    along = np.linspace(0, 1, 5)
    rest = length - blade - 2 * grip
    rise = 0.025 * np.sqrt(along)
    path = np.column_stack([blade / 2 - grip + rest * along, 0 * along, 0.002 + grip * 0.5 + rise])
    return painted(0, flat) + painted(1, tube(path, grip, flatness=0.6, sides=8))


@family(slender=True, length=(0.12, 0.16), radius=(0.0035, 0.007), sides=(6, 16), clip=(0.2, 0.35))
def pen(rng: Rng, *, length: float, radius: float, sides: float, clip: float) -> list[Part]:
    """A pen or a pencil, lying: shaft, tip, clip; few sides make a pencil."""
    del rng
    count = int(sides)
    shaft = lathe([(radius, 0.1 * length), (radius, 0.97 * length), (0.8 * radius, length)], count)
    tip = lathe([(0.0008, 0), (radius, 0.1 * length)], count)
    parts = painted(0, shaft) + painted(1, tip)
    if count > 8:
        bar = box((0.25 * radius, 0.6 * radius, clip * length),
                  (1.15 * radius, 0, (0.95 - clip / 2) * length))  # fmt: skip
        foot = box((0.4 * radius, 0.6 * radius, 0.02 * length), (radius, 0, 0.94 * length))
        parts += painted(1, bar, foot)
    return moved(parts, LYING @ rotation(2, np.pi / 2), (0, 0, radius))


@family(barrel=(0.1, 0.2), girth=(0.022, 0.034), grip=(0.09, 0.14), lean=(0.05, 0.3),
        chuck=(0.03, 0.06), battery=(0.03, 0.06))  # fmt: skip
def drill(
    rng: Rng, *, barrel: float, girth: float, grip: float, lean: float, chuck: float, battery: float
) -> list[Part]:
    """A cordless drill, lying on its side: barrel, chuck, bit, grip, trigger, battery."""
    del rng
    motor = moved(painted(0, lathe([(0.8 * girth, 0), (girth, 0.1 * barrel), (girth, 0.7 * barrel),
                                    (0.7 * girth, barrel)], 16)), LYING)  # fmt: skip
    jaws = moved(painted(1, lathe([(0.65 * girth, 0), (0.65 * girth, 0.5 * chuck),
                                   (0.25 * girth, chuck)], 16)), LYING, (barrel, 0, 0))  # fmt: skip
    bit = moved(painted(2, _rod(0.9 * chuck, 0.003)), LYING, (barrel + chuck, 0, 0))
    handle = rounded_box((1.5 * girth, 1.2 * girth, grip), 0.4 * girth, (0, 0, -grip / 2))
    trigger = rounded_box((0.5 * girth, 0.5 * girth, 0.25 * grip), 0.1 * girth,
                          (0.9 * girth, 0, -girth - 0.12 * grip))  # fmt: skip
    pack = rounded_box((3.2 * girth, 2 * girth, battery), 0.004, (0.2 * girth, 0, -grip))
    lower = painted(0, handle) + painted(1, trigger) + painted(2, pack)
    parts = motor + jaws + bit + moved(lower, rotation(1, lean), (0.35 * barrel, 0, 0))
    return moved(parts, rotation(0, np.pi / 2), (0, 0, girth))


@family(opening=(0.05, 0.12), depth=(0.04, 0.08), bar=(0.008, 0.014), width=(0.012, 0.022),
        travel=(0.2, 0.8))  # fmt: skip
def clamp(
    rng: Rng, *, opening: float, depth: float, bar: float, width: float, travel: float
) -> list[Part]:
    """A screw clamp, lying: a frame of three bars, a screw with a pad and a T handle."""
    del rng
    high = opening + 2 * bar
    spine = box((bar, width, high), (0, 0, 0))
    arms = [box((depth, width, bar), (depth / 2, 0, s * (high - bar) / 2)) for s in (-1, 1)]
    x, radius = 0.85 * depth, 0.3 * width
    low = -high / 2 + bar + travel * opening * 0.8
    screw = lathe([(radius, low), (radius, high / 2 + 0.5 * opening)], 10) + (x, 0, 0)
    pad = lathe([(2.2 * radius, low - 0.005), (2.2 * radius, low)], 12) + (x, 0, 0)
    turner = moved(
        painted(1, _rod(0.7 * depth, 0.6 * radius, -0.35 * depth, 8)),
        rotation(0, np.pi / 2),
        (x, 0, high / 2 + 0.48 * opening),
    )
    parts = painted(0, spine, arms) + painted(1, screw, pad) + turner
    return moved(parts, rotation(0, np.pi / 2), (0, 0, width / 2))


@family(slender=True, length=(0.1, 0.22), grip=(0.01, 0.018), head=(1.2, 1.8), lens=(0.15, 0.25))
def torch_lamp(rng: Rng, *, length: float, grip: float, head: float, lens: float) -> list[Part]:
    """A torch, lying; the radius of its head by that of its grip."""
    del rng
    wide, start = head * grip, (1 - lens) * length
    shaft = lathe([(0.85 * grip, 0), (grip, 0.1 * grip), (grip, start - grip)], 16)
    cone = lathe([(grip, start - grip), (wide, start)], 16)
    hood = lathe([(wide, start), (wide, length)], 16)
    button = box((0.6 * grip, 0.5 * grip, 1.2 * grip), (-0.8 * grip, 0, 0.5 * length))
    return moved(
        painted(0, shaft, cone) + painted(1, hood) + painted(2, button), LYING, (0, 0, wide)
    )


@family(blade=(0.05, 0.1), handle=(0.022, 0.032), gap=(0.15, 0.6), bar=(0.003, 0.006))
def scissors(rng: Rng, *, blade: float, handle: float, gap: float, bar: float) -> list[Part]:
    """Scissors, lying open: two blades that cross and two rings."""
    del rng
    parts: list[Part] = []
    for side in (-1, 1):
        edge = prism(np.array([[-0.03, -2 * bar], [-0.03, 2 * bar], [blade, 0.3 * bar],
                               [blade, -0.3 * bar]]), 0, 0.0022)  # fmt: skip
        loop = ring(
            [(0.65 * handle, 0), (handle, 0), (handle, 2 * bar), (0.65 * handle, 2 * bar)], 16
        )
        bow = [piece * (1.3, 0.8, 1) + (-0.03 - handle, -0.4 * side * handle, 0) for piece in loop]
        half = painted(1, edge) + painted(0, bow)
        parts += moved(half, rotation(2, side * gap / 2), (0, 0, 0.002 if side > 0 else 0))
    return parts


@family(reach=(0.09, 0.12), bend=(0.5, 1.4), girth=(0.014, 0.02), flatness=(0.85, 1.0))
def banana(rng: Rng, *, reach: float, bend: float, girth: float, flatness: float) -> list[Part]:
    """A banana, lying: a bent rod that narrows towards stem and tip."""
    del rng
    path = arc((0, 0, 0), reach / max(np.sin(bend), 0.5), -bend, bend, 9)
    path = path[:, [0, 2, 1]]
    narrowing = np.array([0.3, 0.7, 0.92, 1, 1, 1, 0.92, 0.75, 0.4])
    return moved(painted(0, tube(path - path.mean(axis=0), girth * narrowing, flatness)),
                 shift=(0, 0, girth * flatness))  # fmt: skip


@family(length=(0.12, 0.3), radius=(0.002, 0.004), plug=(0.018, 0.045), bend=(0.5, 2.5))
def cable_end(rng: Rng, *, length: float, radius: float, plug: float, bend: float) -> list[Part]:
    """A bent end of a cable with its plug."""
    turns = np.cumsum(rng.normal(0, bend / 6, 12) + rng.uniform(-1, 1) * bend / 12)
    steps = length / 12 * np.column_stack([np.cos(turns), np.sin(turns)])
    flat = np.concatenate([[[0, 0]], np.cumsum(steps, axis=0)])
    path = np.column_stack([flat, np.full(len(flat), radius)])
    body = rounded_box((plug, 0.6 * plug, 0.35 * plug), 0.1 * plug, (-0.5 * plug, 0, 0.175 * plug))
    pins = box((0.35 * plug, 0.4 * plug, 0.15 * plug), (-1.17 * plug, 0, 0.175 * plug))
    return painted(0, tube(path, radius, sides=8), body) + painted(1, pins)
