"""Superquadrics fitted to points of their surface, and to places that lie outside."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from scenefw.core.errors import SettingError
from scenefw.core.evidence import FittedSuperquadric
from scenefw.core.settings import COUNT, NOT_NEGATIVE, POSITIVE
from scenefw.core.types import Pose
from scenefw.fitting.placed import OUTLIERS, signed_distance
from scenefw.fitting.starts import box_starts
from scenefw.kernels.superquadric_fit import COST, DAMPING, LANES, STATE, TYPICAL, WORK, advance

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.random import Generator
    from torch import Tensor

    from scenefw.core.evidence import Evidence
    from scenefw.core.types import Float64

_WIDENING = 4  # factor of the limit of outliers, twice, then once: no poor start is all outliers
_FIRST_DAMPING = 1e-2  # of Levenberg-Marquardt: nearly Gauss-Newton
_FIRST_EXPONENT = 4.0  # between an ellipsoid's, 2, and those of boxes


@dataclass(frozen=True, eq=False)
class Sizes:
    """Half-axes that objects are expected to have where nothing is seen of them.

    Args:
        typical: (N, 3) m, of each object; of a new fit, one for all objects.
        stiffness: how much an e times longer or shorter one costs, in squared deviations.
    """

    typical: Float64
    stiffness: float


class SuperquadricFit:
    """Fits superquadrics by Levenberg-Marquardt from several starts (thesis eqs 5.8 to 5.12).

    Twelve numbers: centre, rotation, logarithms of half-axes, exponents. Residuals are robust
    (Geman and McClure 1987), so a fifth of the points may belong to something else.

    Args:
        exponents: least and greatest.
        half_axes: least and greatest (m).
        steps: of the method from the best starts.
        rounds: steps with wider limits of outliers, 16 and 4 times `OUTLIERS`; then the worse two
            thirds of the starts are given up.
        typical: half-axis (m) that is taken where the points say nothing.
        stiffness: how much an e times longer or shorter one costs, in squared deviations.
        spread: standard deviation of the logarithms of half-axes that `draws` expects.
        device: torch device.

    Raises:
        ConfigError: bounds out of order, or numbers that aren't positive.
    """

    def __init__(
        self,
        exponents: tuple[float, float] = (1.6, 100.0),
        half_axes: tuple[float, float] = (0.008, 0.5),
        steps: int = 40,
        rounds: int = 16,
        typical: float = 0.06,
        stiffness: float = 0.3,
        spread: float = 0.8,
        device: str = "cpu",
    ) -> None:
        for name, (low, high) in (("exponents", exponents), ("half_axes", half_axes)):
            if not 0 < low < high:
                raise SettingError(name, (low, high), "two numbers above 0, the smaller first")
        if exponents[0] < 1:
            raise SettingError("exponents", exponents, "1 or more (below 1: not convex)")
        POSITIVE.require(typical=typical, spread=spread)
        COUNT.require(steps=steps, rounds=rounds)
        NOT_NEGATIVE.require(stiffness=stiffness)
        self.exponents, self.half_axes = exponents, half_axes
        self.steps, self.rounds = steps, rounds
        self.typical, self.stiffness, self.spread = typical, stiffness, spread
        self.device = torch.device(device)

    def fit(self, evidence: Sequence[Evidence]) -> list[FittedSuperquadric]:
        """The best superquadric for each, from boxes about its points."""
        starts = [
            np.stack([self._state(*box) for box in box_starts(item.points, _reliable_points(item))])
            for item in evidence
        ]
        return (
            self._best_fits(evidence, starts, (_WIDENING**2, _WIDENING), self.stiffness)
            if evidence
            else []
        )

    def refit(
        self,
        evidence: Sequence[Evidence],
        fitted: Sequence[FittedSuperquadric],
        sizes: Sizes | None = None,
    ) -> list[FittedSuperquadric]:
        """The same, starting from superquadrics that are nearly right.

        Args:
            evidence: about each object.
            fitted: where to start.
            sizes: expected; None = the typical one.
        """
        stiffness = self.stiffness if sizes is None else sizes.stiffness
        starts = []
        for k, superquadric in enumerate(fitted):
            start = self._state(superquadric.pose, superquadric.half_axes, superquadric.exponents)
            if sizes is not None:
                start[TYPICAL:] = np.log(sizes.typical[k])
            starts.append(start[None])
        return self._best_fits(evidence, starts, (), stiffness) if evidence else []

    def separate(
        self, evidence: Sequence[Evidence], fits: Sequence[FittedSuperquadric]
    ) -> list[FittedSuperquadric]:
        """The fits as they are: each object stands by itself."""
        return list(fits)

    def together(
        self, evidence: Sequence[Evidence], start: Sequence[FittedSuperquadric]
    ) -> list[FittedSuperquadric]:
        """Superquadrics near those, each by itself."""
        return self.refit(evidence, start)

    def draws(
        self,
        evidence: Sequence[Evidence],
        fits: Sequence[FittedSuperquadric],
        count: int,
        generator: Generator,
    ) -> list[list[FittedSuperquadric]]:
        """Draws of what the superquadrics may be as well.

        Each draw fits them again with other expected sizes (randomize-then-optimize, Bardsley et
        al. 2014): what the points decide stays, what they leave open varies.

        Args:
            evidence: about each object.
            fits: the best ones.
            count: of draws.
            generator: of random numbers.
        """
        return [
            self.refit(evidence, fits, self.sizes(len(evidence), generator)) for _ in range(count)
        ]

    def sizes(self, count: int, generator: Generator) -> Sizes:
        """Random expected sizes of so many objects."""
        log_sizes = np.log(self.typical) + self.spread * generator.standard_normal((count, 3))
        return Sizes(np.exp(log_sizes), 1 / self.spread**2)

    def _best_fits(
        self,
        evidence: Sequence[Evidence],
        starts: Sequence[Float64],
        outlier_factors: Sequence[float],
        stiffness: float,
    ) -> list[FittedSuperquadric]:
        problem = _Problem.of(evidence, starts, self.device)
        for factor in outlier_factors:
            self._advance(problem, self.rounds, factor * OUTLIERS, stiffness)
        if outlier_factors:
            problem = problem.promising()
        self._advance(problem, self.steps, OUTLIERS, stiffness)
        states = problem.states.cpu().numpy()
        owners = problem.owners.cpu().numpy()
        best = [
            min(np.flatnonzero(owners == k), key=lambda row: states[row, COST])
            for k in range(len(evidence))
        ]
        return [self._result(states[row], item) for row, item in zip(best, evidence, strict=True)]

    def _advance(self, problem: _Problem, steps: int, limit: float, stiffness: float) -> None:
        count = len(problem.states)
        work = torch.empty((count, WORK), dtype=torch.float64, device=self.device)
        lanes = torch.empty((count, LANES), dtype=torch.float32, device=self.device)
        settings = torch.tensor(
            [*np.log([*self.exponents, *self.half_axes]), stiffness],
            dtype=torch.float64,
            device=self.device,
        )
        advance(
            count,
            problem.places,
            problem.sigmas,
            problem.objects,
            problem.states,
            work,
            lanes,
            settings,
            steps,
            float(limit),
        )

    def _state(
        self, pose: Pose, half_axes: Float64, exponents: Float64 | float = _FIRST_EXPONENT
    ) -> Float64:
        low, high = self.half_axes
        state = np.zeros(STATE)
        state[:3], state[3:12] = pose.position, np.ravel(pose.rotation)
        state[12:15] = np.log(np.clip(half_axes, low * 1.01, high * 0.99))
        low, high = np.log(self.exponents)
        share = (np.log(exponents) - low) / (high - low)
        share = np.clip(share, 0.05 if np.isscalar(exponents) else 0.003, 0.997)
        state[15:18] = np.log(share / (1 - share))
        state[DAMPING], state[TYPICAL:] = _FIRST_DAMPING, np.log(self.typical)
        return state

    def _result(self, state: Float64, evidence: Evidence) -> FittedSuperquadric:
        low, high = np.log(self.exponents)
        exponents = np.exp(low + (high - low) / (1 + np.exp(-state[15:18])))
        rotation = Rotation.from_matrix(state[3:12].reshape(3, 3))
        pose = Pose(state[:3], np.roll(rotation.as_quat(), 1))
        cost = float(state[COST])
        fit = FittedSuperquadric(np.exp(state[12:15]), exponents, pose, cost, np.empty(0))
        return replace(fit, distances=signed_distance(fit, evidence.points))


def _reliable_points(evidence: Evidence) -> Float64:
    """The surest points (N, 3): those that were seen, where others are supposed."""
    return evidence.points[evidence.sigmas <= evidence.sigmas.min()]


@dataclass
class _Problem:
    """All starts of all objects, as the kernel takes them."""

    places: Tensor
    sigmas: Tensor
    objects: Tensor
    states: Tensor
    owners: Tensor

    @classmethod
    def of(
        cls, evidence: Sequence[Evidence], starts: Sequence[Float64], device: torch.device
    ) -> _Problem:
        places = np.concatenate([part for item in evidence for part in (item.points, item.outside)])
        sigmas = np.concatenate(
            [part for item in evidence for part in (item.sigmas, item.outside_sigmas)]
        )
        sizes = [[len(item.points), len(item.outside)] for item in evidence]
        ends = np.cumsum([0, *np.ravel(sizes)])
        ranges = np.stack([ends[0:-2:2], ends[1:-1:2], ends[2::2]], axis=1)
        owners = np.repeat(np.arange(len(starts)), [len(rows) for rows in starts])

        def tensor(array: np.ndarray, dtype: torch.dtype) -> Tensor:
            return torch.as_tensor(array, dtype=dtype, device=device).contiguous()

        return cls(
            tensor(places, torch.float32),
            tensor(sigmas, torch.float32),
            tensor(ranges[owners], torch.int32),
            tensor(np.concatenate(starts), torch.float64),
            tensor(owners, torch.int64),
        )

    def promising(self) -> _Problem:
        """The best third of each object's starts."""
        costs, owners = self.states[:, COST].cpu().numpy(), self.owners.cpu().numpy()
        selection: list[int] = []
        for owner in np.unique(owners):
            rows = np.flatnonzero(owners == owner)
            selection.extend(rows[np.argsort(costs[rows])][: max(1, len(rows) // 3)])
        indices = torch.as_tensor(selection, device=self.states.device)
        return replace(
            self,
            objects=self.objects[indices].contiguous(),
            states=self.states[indices].contiguous(),
            owners=self.owners[indices].contiguous(),
        )
