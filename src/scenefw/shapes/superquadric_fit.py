"""Superquadrics fitted to points of their surface, and to points that lie outside.

A robust Levenberg-Marquardt method on twelve numbers: centre, rotation, logarithms of half-axes,
and exponents. After thesis eqs 5.8 to 5.12, with places outside for collisions and the floor.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenefw.core.errors import ConfigError
from scenefw.core.types import Pose
from scenefw.shapes.superquadric import Superquadric

Array = NDArray[np.float64]

_NUMBERS = 12
_NEWTON_STEPS = 12
_TINY = 1e-9


@dataclass(frozen=True, eq=False)
class Evidence:
    """Points that say where an object is and where it isn't.

    Args:
        points: (N, 3) on the surface, world coordinates (m).
        sigmas: (N,) standard deviations of their distance to it (m).
        outside: (M, 3) that the object doesn't contain (m).
        outside_sigma: how deep one may lie in it all the same (m).
    """

    points: Array
    sigmas: Array
    outside: Array = field(default_factory=lambda: np.empty((0, 3)))
    outside_sigma: float = 0.004


@dataclass(frozen=True, eq=False)
class FittedSuperquadric:
    """A superquadric where it lies, and how well it explains what it was fitted to.

    Args:
        shape: the superquadric.
        pose: from its frame to the world.
        cost: what the fit made least, per point.
        distances: (N,) of the points to its surface (m), negative inside; of first order.
    """

    shape: Superquadric
    pose: Pose
    cost: float
    distances: Array


class SuperquadricFit:
    """Fits superquadrics by Levenberg-Marquardt from several starts.

    Distances are of first order: (1 - 1/g) / |grad ln g| of the gauge g, the factor by which the
    shape must grow to reach a point. Residuals are robust (Geman and McClure 1987), so a fifth of
    the points may belong to something else.

    Args:
        exponents: least and greatest.
        half_axes: least and greatest (m).
        steps: of the method from the best starts.
        outliers: residuals, in standard deviations, from which on points count less and less. It
            begins 16 times as large, then 4 times, so that a poor start is not all outliers.
        rounds: steps with each of these; then the worse two thirds of the starts are given up.
        typical: half-axis (m) that is taken where the points say nothing.
        stiffness: how much an e times longer or shorter one costs, in squared deviations.

    Raises:
        ConfigError: bounds out of order, or numbers that aren't positive.
    """

    def __init__(
        self,
        exponents: tuple[float, float] = (1.6, 100.0),
        half_axes: tuple[float, float] = (0.008, 0.5),
        steps: int = 40,
        outliers: float = 3.0,
        rounds: int = 8,
        typical: float = 0.06,
        stiffness: float = 1.0,
    ) -> None:
        for name, (low, high) in (("exponents", exponents), ("half_axes", half_axes)):
            if not 0 < low < high:
                raise ConfigError(f"{name} = {low}, {high}: expected two positive numbers in order")
        if exponents[0] < 1 or min(steps, rounds, outliers, typical) <= 0 or stiffness < 0:
            raise ConfigError(
                f"exponents from {exponents[0]}, steps {steps}, rounds {rounds}, outliers "
                f"{outliers}, typical {typical}, stiffness {stiffness}: expected exponents from 1 "
                "(convex), and positive numbers"
            )
        self.exponents, self.half_axes = exponents, half_axes
        self.steps, self.outliers, self.rounds = steps, outliers, rounds
        self.typical, self.stiffness = typical, stiffness

    def fit(self, evidence: Evidence, starts: list[tuple[Pose, Array]]) -> FittedSuperquadric:
        """The best of the fits from all starts.

        Args:
            evidence: what it should explain.
            starts: poses and half-axes (m) to start from, at least one.
        """
        runs = [_Run(self, evidence, *start) for start in starts]
        for run in runs:
            for limit in (16 * self.outliers, 4 * self.outliers):
                run.advance(self.rounds, limit)
        runs.sort(key=lambda run: run.cost)
        best = runs[: max(1, len(runs) // 3)]
        for run in best:
            run.advance(self.steps, self.outliers)
        return min(best, key=lambda run: run.cost).result()


class _Run:
    """One start on its way to a minimum."""

    def __init__(
        self, settings: SuperquadricFit, evidence: Evidence, pose: Pose, half_axes: Array
    ) -> None:
        self.settings, self.evidence = settings, evidence
        self.centre = np.array(pose.position, dtype=np.float64)
        self.rotation = np.array(pose.rotation, dtype=np.float64)
        low, high = settings.half_axes
        self.log_axes = np.log(np.clip(half_axes, low * 1.01, high * 0.99))
        low, high = np.log(settings.exponents)
        first = np.clip(np.log(4.0), 0.95 * low + 0.05 * high, 0.05 * low + 0.95 * high)
        self.free = np.full(3, _unbounded(first, low, high))  # exponents, without bounds
        self.damping = 1e-2
        self.everywhere = np.concatenate([evidence.points, evidence.outside])
        self.of_surface = np.arange(len(self.everywhere)) < len(evidence.points)
        deep = np.full(len(evidence.outside), evidence.outside_sigma)
        self.sigmas = np.concatenate([evidence.sigmas, deep])
        self.limit, self.cost, self.stuck = settings.outliers, np.inf, False

    def advance(self, steps: int, limit: float) -> None:
        """Takes steps, until nothing improves, with outliers from `limit` deviations on."""
        self.limit, self.stuck = limit, False
        self.cost = self._cost()
        for _ in range(steps):
            if self.stuck:
                return
            self._step()

    def _step(self) -> None:
        residuals, jacobian, weights = self._linearised()
        weighted = jacobian * weights[:, None]
        normal, slope = weighted.T @ jacobian, weighted.T @ residuals
        unusual, stiff = self._unusual()
        normal[np.diag_indices(_NUMBERS)] += stiff
        slope += stiff * unusual
        before = self.state()
        for _ in range(6):
            damped = normal + self.damping * np.diag(np.diag(normal) + 1e-6)
            step: Array = np.asarray(np.linalg.solve(damped, -slope), dtype=np.float64)
            self._move(step)
            cost = self._cost()
            if cost < self.cost:
                self.stuck = self.cost - cost < 1e-5 * self.cost
                self.cost, self.damping = cost, max(self.damping / 4, 1e-6)
                return
            self.restore(before)
            self.damping = min(self.damping * 5, 1e4)
        self.stuck = True

    def state(self) -> tuple[Array, ...]:
        """What a step changes."""
        return (self.centre, self.rotation, self.log_axes, self.free)

    def restore(self, state: tuple[Array, ...]) -> None:
        """Goes back to an earlier state."""
        self.centre, self.rotation, self.log_axes, self.free = state

    def _move(self, step: Array) -> None:
        step = np.clip(step, -0.5, 0.5)
        self.centre = self.centre + self.rotation @ step[:3]
        self.rotation = self.rotation @ Rotation.from_rotvec(step[3:6]).as_matrix()
        low, high = np.log(self.settings.half_axes)
        self.log_axes = np.clip(self.log_axes + step[6:9], low, high)
        self.free = np.clip(self.free + step[9:], -6, 6)

    def _exponents(self) -> tuple[Array, Array]:
        """Exponents, and their slopes by the free numbers."""
        low, high = np.log(self.settings.exponents)
        share = 1 / (1 + np.exp(-self.free))
        exponents = np.exp(low + (high - low) * share)
        return exponents, exponents * (high - low) * share * (1 - share)

    def _distances(self) -> tuple[Array, Array, Array, Array, Array]:
        """First-order distances (K,), and what their derivatives are made of."""
        local = (self.everywhere - self.centre) @ self.rotation
        exponents, slopes = self._exponents()
        units = np.log(np.maximum(np.abs(local), _TINY)) - self.log_axes
        gauge = _log_gauge(units, exponents)
        powers = np.exp(np.minimum(exponents * (units - gauge[:, None]), 0.0))
        total = (exponents * powers).sum(axis=1)
        shares = exponents * powers / total[:, None]  # of d gauge / d units
        safe = np.where(np.abs(local) < _TINY, _TINY, local)
        gradient = shares / safe
        steep = np.maximum(np.linalg.norm(gradient, axis=1), 1e-3)
        by_exponent = powers * (units - gauge[:, None]) / total[:, None] * slopes
        distance = (1 - np.exp(-np.maximum(gauge, -3.0))) / steep
        scale = np.exp(-np.maximum(gauge, -3.0)) / steep
        # A turn w of the frame moves a local point by -w x point: the gauge by w (slope x point)
        columns = np.concatenate(
            [-gradient, np.cross(gradient, local), -shares, by_exponent], axis=1
        )
        return distance, scale, columns, local, gauge

    def _residuals(self, distance: Array) -> Array:
        inside = np.minimum(distance, 0.0)
        return np.where(self.of_surface, distance, inside) / self.sigmas

    def _linearised(self) -> tuple[Array, Array, Array]:
        distance, scale, columns, _, _ = self._distances()
        residuals = self._residuals(distance)
        active = self.of_surface | (distance < 0)
        jacobian = columns * (scale * active / self.sigmas)[:, None]
        softened = 1 + (residuals / self.limit) ** 2
        return residuals, jacobian, np.where(self.of_surface, softened**-2, 1.0)

    def _cost(self) -> float:
        residuals = self._residuals(self._distances()[0])
        squares = residuals**2
        robust = np.where(self.of_surface, squares / (1 + squares / self.limit**2), squares)
        unusual, stiff = self._unusual()
        return float((robust.sum() + stiff @ unusual**2) / len(self.evidence.points))

    def _unusual(self) -> tuple[Array, Array]:
        """How far size and exponents are from common ones, and how much that costs.

        It decides what the points leave open, such as the thickness of a box of which one side is
        seen, and little else.
        """
        size = self.log_axes - np.log(self.settings.typical)
        weights = self.settings.stiffness * np.r_[np.zeros(6), np.ones(3), np.full(3, 0.25)]
        return np.r_[np.zeros(6), size, self.free], weights

    def result(self) -> FittedSuperquadric:
        """Where it is now."""
        exponents, _ = self._exponents()
        quaternion = np.roll(Rotation.from_matrix(self.rotation).as_quat(), 1)
        distance = self._distances()[0][self.of_surface]
        shape = Superquadric(np.exp(self.log_axes), exponents)
        return FittedSuperquadric(shape, Pose(self.centre, quaternion), self.cost, distance)


def _unbounded(value: float, low: float, high: float) -> float:
    share = (value - low) / (high - low)
    return float(np.log(share / (1 - share)))


def _log_gauge(units: Array, exponents: Array) -> Array:
    """The l with sum e^(r_i (u_i - l)) = 1 (K,), by Newton's method from below."""
    gauge = units.max(axis=1)
    for _ in range(_NEWTON_STEPS):
        powers = np.exp(exponents * (units - gauge[:, None]))
        total = powers.sum(axis=1)
        step = np.log(total) * total / (exponents * powers).sum(axis=1)
        gauge = gauge + step
        if np.abs(step).max(initial=0.0) < 1e-9:
            break
    return gauge
