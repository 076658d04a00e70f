"""Model planes: airliners, propeller planes, biplanes and jets with wings, tail and fuselage."""

from __future__ import annotations

import numpy as np

from scenefw_tabletops.shapes.tabletop import colours, parts
from scenefw_tabletops.shapes.tabletop.parts import Array, Look, Part

_SIDES = 14


def model_plane(rng: np.random.Generator) -> list[Part]:
    """A plane along x, nose to +x, 12..30 cm long, on its belly or its wheels."""
    kind = ("airliner", "propeller", "biplane", "jet")[rng.choice(4, p=[0.35, 0.3, 0.15, 0.2])]
    length = rng.uniform(0.12, 0.30)
    plane = _Plane(rng, kind, length)
    return plane.parts()


class _Plane:
    def __init__(self, rng: np.random.Generator, kind: str, length: float) -> None:
        self.rng, self.kind, self.length = rng, kind, length
        self.radius = length * {
            "airliner": rng.uniform(0.05, 0.065), "propeller": rng.uniform(0.065, 0.09),
            "biplane": rng.uniform(0.065, 0.085), "jet": rng.uniform(0.045, 0.06),
        }[kind]  # fmt: skip
        body = colours.grey(rng.uniform(0.75, 0.95)) if rng.random() < 0.4 else colours.vivid(rng)
        if rng.random() < 0.25:
            body = colours.metal(rng)
        second = colours.vivid(rng)
        self.body = colours.painted(rng, body, second)
        self.wings = self.body if rng.random() < 0.5 else colours.painted(rng, second, body)
        self.accent = Look(second, gloss=0.2)
        self.glass = Look(colours.hsv(0.58, 0.5, rng.uniform(0.1, 0.35)), gloss=0.7)
        self.dark = Look(colours.grey(0.12), gloss=0.1)

    def parts(self) -> list[Part]:
        """All of the plane."""
        pieces = [self._fuselage(), *self._cockpit(), *self._tail()]
        pieces += getattr(self, f"_{self.kind}")()
        if self.kind != "jet" and self.rng.random() < 0.6:
            pieces += self._wheels()
        return pieces

    def _fuselage(self) -> Part:
        nose = {"airliner": 0.12, "propeller": 0.10, "biplane": 0.08, "jet": 0.35}[self.kind]
        tail, end = self.rng.uniform(0.3, 0.45), self.rng.uniform(0.12, 0.3)
        if self.kind == "jet":
            tail, end = 0.15, 0.75
        t = np.linspace(0, 1, 22)
        front = np.sqrt(np.clip(1 - ((t - 1 + nose) / nose).clip(0, 1) ** 2, 0, 1))
        rear = 1 - (1 - end) * ((tail - t) / tail).clip(0, 1) ** 1.6
        radius = self.radius * np.minimum(front, rear).clip(0.02, 1)
        part = parts.lathe(np.column_stack([(t - 0.5) * self.length, radius]), self.body, _SIDES)
        vertices = part.vertices  # the tail rises, so that the plane can take off
        rise = ((0.5 - tail) * self.length * -1 - vertices[:, 0]).clip(min=0)
        vertices[:, 2] += 0.0 if self.kind == "jet" else 1.0 * rise * self.radius / self.length
        return part

    def _cockpit(self) -> list[Part]:
        place = {"airliner": 0.41, "propeller": 0.14, "biplane": 0.02, "jet": 0.2}[self.kind]
        size = {"airliner": 0.05, "propeller": 0.13, "biplane": 0.08, "jet": 0.12}[self.kind]
        t = np.linspace(-1, 1, 8)
        bulge = np.sqrt(np.clip(1 - t**2, 0.01, 1)) * self.radius * 0.62
        glass = parts.lathe(np.column_stack([t * size * self.length, bulge]), self.glass, 10)
        height = 0.42 if self.kind == "airliner" else 0.62
        pieces = [glass.moved([place * self.length, 0, height * self.radius])]
        if self.kind == "airliner":
            pieces += self._windows()
        return pieces

    def _windows(self) -> list[Part]:
        size, r = 0.022 * self.length, self.radius
        out = 0.954 * r - 0.0007  # 0.3 mm proud of the side at this height
        places = np.arange(-0.03, 0.34, 0.045) * self.length
        return [
            parts.box((size, 0.002, 1.3 * size), (x, side * out, 0.3 * r), self.glass)
            for x in places
            for side in (-1, 1)
        ]

    def _tail(self) -> list[Part]:
        end, r = -0.5 * self.length, self.radius
        high = self.length * self.rng.uniform(0.12, 0.18)
        chord = self.length * self.rng.uniform(0.11, 0.16)
        sweep = self.length * (0.1 if self.kind in ("airliner", "jet") else 0.04)
        lift = 0.3 * r
        span = self.length * self.rng.uniform(0.14, 0.2)
        plane = _wing(span, chord, 0.55 * chord, sweep, 0.05 * span, self.wings)
        tailplanes = [plane, plane.turned(np.diag([1, -1, 1]))]
        pieces = [wing.moved([end + chord, 0, lift]) for wing in tailplanes]
        fin = _wing(high, chord, 0.5 * chord, sweep, 0.0, self.accent)
        upright = fin.turned([[1, 0, 0], [0, 0, 1], [0, 1, 0]])
        sides = (-0.6 * r, 0.6 * r) if self.kind == "jet" and self.rng.random() < 0.6 else (0.0,)
        return [*pieces, *(upright.moved([end + chord, y, 0.3 * r]) for y in sides)]

    def _main(
        self, span: float, chord: float, tip: float, sweep: float, up: float, place: Array
    ) -> list[Part]:
        wing = _wing(span, chord, tip, sweep, up, self.wings)
        pieces = [wing, wing.turned(np.diag([1, -1, 1]))]
        if self.rng.random() < 0.5:  # tips of another colour
            low = np.array([-sweep * 0.82, span * 0.82, up * 0.82])
            cap = _wing(0.18 * span, chord + 0.82 * (tip - chord), tip, 0.18 * sweep, 0.18 * up,
                        self.accent, 1.25).moved(low)  # fmt: skip
            pieces += [cap, cap.turned(np.diag([1, -1, 1]))]
        return [part.moved(place) for part in pieces]

    def _airliner(self) -> list[Part]:
        long, r, rng = self.length, self.radius, self.rng
        span, chord = long * rng.uniform(0.42, 0.52), long * rng.uniform(0.16, 0.21)
        sweep = span * rng.uniform(0.4, 0.6)
        place = np.array([0.14 * long, 0, -0.45 * r])
        pieces = self._main(span, chord, 0.3 * chord, sweep, 0.08 * span, place)
        engine = np.array([[-0.05, 0.6], [-0.02, 0.95], [0.03, 1.0], [0.05, 0.8]])
        engine *= [long, 0.4 * r]
        nacelle = parts.lathe(engine, self.accent, 10)
        for share in (0.35, 0.62)[: int(rng.integers(1, 3))]:
            at = place + [0.03 * long - share * sweep, share * span, share * 0.08 * span - 0.45 * r]
            pieces += [nacelle.moved(at), nacelle.moved(at * [1, -1, 1])]
        return pieces

    def _propeller(self) -> list[Part]:
        long, r, rng = self.length, self.radius, self.rng
        span, chord = long * rng.uniform(0.45, 0.62), long * rng.uniform(0.15, 0.22)
        high = rng.random() < 0.5
        place = np.array([0.22 * long, 0, 0.85 * r if high else -0.5 * r])
        wings = self._main(
            span, chord, rng.uniform(0.6, 1) * chord, 0.02 * long, 0.06 * span, place
        )
        return [*wings, *self._airscrew()]

    def _biplane(self) -> list[Part]:
        long, r, rng = self.length, self.radius, self.rng
        span, chord = long * rng.uniform(0.45, 0.58), long * rng.uniform(0.16, 0.2)
        pieces = []
        low, high = -0.7 * r, 1.9 * r
        for height, shift in ((low, 0.0), (high, 0.03)):
            place = np.array([(0.22 + shift) * long, 0, height])
            pieces += self._main(span, chord, 0.9 * chord, 0.0, 0.0, place)
        for side in (-0.7, 0.7, -0.12, 0.12):
            for offset in (0.18, 0.1):
                path = [
                    [offset * long, side * span, low],
                    [(offset + 0.03) * long, side * span, high],
                ]
                pieces.append(parts.tube(path, 0.006 * long, self.dark, 6))
        return [*pieces, *self._airscrew()]

    def _jet(self) -> list[Part]:
        long, r, rng = self.length, self.radius, self.rng
        span, chord = long * rng.uniform(0.26, 0.36), long * rng.uniform(0.36, 0.5)
        place = np.array([0.12 * long, 0, -0.1 * r])
        pieces = self._main(span, chord, 0.22 * chord, 0.62 * chord, 0.0, place)
        for side in (-1, 1):
            size = (0.3 * long, 0.9 * r, 1.1 * r)
            pieces.append(
                parts.box(size, (0.03 * long, side * 0.95 * r, -0.2 * r), self.body, 0.3 * r)
            )
        return pieces

    def _airscrew(self) -> list[Part]:
        long, r = self.length, self.radius
        tip = np.array([[0.46, 0.3], [0.5, 0.28], [0.53, 0.04]]) * [long, r / 0.9]
        pieces = [parts.lathe(tip, self.accent, 10)]
        turn = self.rng.uniform(0.2, np.pi - 0.2)
        blades = int(self.rng.integers(2, 4))
        for angle in turn + np.arange(blades) * 2 * np.pi / blades:
            blade = parts.box(
                (0.006 * long, 2.2 * r, 0.03 * long), (0.515 * long, 1.1 * r, 0), self.dark
            )
            c, s = np.cos(angle), np.sin(angle)
            blade = blade.turned([[1, 0, 0], [0, c, -s], [0, s, c]])
            pieces.append(blade)
        return pieces

    def _wheels(self) -> list[Part]:
        long, r = self.length, self.radius
        size = 0.35 * r
        wheel = parts.lathe([[-0.2 * size, size], [0.2 * size, size]], self.dark, 12)
        wheel = wheel.turned([[0, 1, 0], [1, 0, 0], [0, 0, 1]])
        pieces = []
        for x, y in ((0.3, 0.0), (0.02, 1.0), (0.02, -1.0)):
            at = np.array([x * long, y * 1.1 * r, -1.35 * r])
            pieces.append(wheel.moved(at))
            up = np.array([at, [at[0], 0.5 * at[1], 0.0]])
            pieces.append(parts.tube(up, 0.006 * long, self.dark, 6))
        return pieces


def _wing(
    span: float, root: float, tip: float, sweep: float, up: float, look: Look, thick: float = 1.0
) -> Part:
    """A wing towards +y; its root's leading edge at x = 0, its tip back by `sweep`."""
    profile = np.array(
        [[0.0, 0], [-0.05, -0.4], [-0.3, -0.6], [-0.65, -0.4], [-1, 0], [-0.65, 0.6], [-0.3, 1.0],
         [-0.05, 0.5]]
    )  # fmt: skip
    rings = []
    for share in (0.0, 0.5, 0.92, 1.0):
        chord = root + (tip - root) * share
        chord *= 0.82 if share == 1.0 else 1.0
        height = thick * np.clip(0.055 * root, 0.0015, 0.004) * (1 - 0.4 * share)
        ring = np.column_stack(
            [profile[:, 0] * chord - sweep * share, np.full(8, span * share),
             profile[:, 1] * height + up * share]
        )  # fmt: skip
        rings.append(ring)
    return parts.loft(rings, look)
