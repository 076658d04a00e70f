"""Superquadrics of one scene fitted together: they don't penetrate each other."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.errors import ConfigError
from scenefw.fitting.placed import in_frame_of, shape_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.random import Generator

    from scenefw.core.evidence import Evidence, FittedSuperquadric
    from scenefw.core.types import Float64
    from scenefw.fitting.superquadrics import Sizes, SuperquadricFit

_GROWTH = 0.03  # m, of half-axes in one round
_SHELLS = (0.95, 0.7, 0.4)  # of sizes: objects that coincide have no surface inside each other


class JointFit:
    """Fits each object alone, then again with the others outside of it (thesis 5.2.5).

    Hidden parts are what this decides: seen points of other objects lie outside from the start.
    The others begin as small cores and grow to their size, so that objects meet halfway.

    Args:
        inner: fits objects one by one.
        rounds: how often all are fitted again.
        resolution: of the others, in points along an edge of the cube about each.
        sigma: how deep a point of another may lie inside (m). It is large, so that
            this never outweighs what is seen of an object.

    Raises:
        ConfigError: a number below one, or a deviation that isn't positive.
    """

    def __init__(
        self, inner: SuperquadricFit, rounds: int = 2, resolution: int = 6, sigma: float = 0.02
    ) -> None:
        if rounds < 1 or resolution < 1 or not sigma > 0:
            raise ConfigError(
                f"a joint fit has rounds {rounds}, resolution {resolution} and sigma {sigma}; "
                "expected 1 or more and a positive deviation"
            )
        self.inner, self.rounds, self.resolution, self.sigma = inner, rounds, resolution, sigma

    def fit(self, evidence: Sequence[Evidence]) -> list[FittedSuperquadric]:
        """The best superquadric for each."""
        return self._apart(evidence, self.inner.fit(evidence))

    def draws(
        self, evidence: Sequence[Evidence], count: int, generator: Generator
    ) -> list[list[FittedSuperquadric]]:
        """The best superquadrics, and then draws that don't penetrate each other either.

        Args:
            evidence: about each object.
            count: of results, with the best ones.
            generator: of random numbers, for other expected sizes.
        """
        alone = self.inner.fit(evidence)
        found = [self._apart(evidence, alone)]
        for _ in range(count - 1):
            sizes = self.inner.sizes(len(evidence), generator)
            found.append(self._apart(evidence, self.inner.refit(evidence, alone, sizes), sizes))
        return found

    def _apart(
        self,
        evidence: Sequence[Evidence],
        fitted: list[FittedSuperquadric],
        sizes: Sizes | None = None,
    ) -> list[FittedSuperquadric]:
        """Fitted again until none penetrates another, or rounds are over."""
        for number in range(1, self.rounds + 1):
            if not self._overlapping(fitted):
                break
            places = [self._places(one, number / self.rounds) for one in fitted]
            joint = [
                self._with(one, [_near(fitted[k], other) for other in _others(places, k)])
                for k, one in enumerate(evidence)
            ]
            fitted = self.inner.refit(joint, fitted, sizes)
        return fitted

    def _with(self, evidence: Evidence, others: list[Float64]) -> Evidence:
        outside = np.concatenate([evidence.outside, *others])
        added = np.full(len(outside) - len(evidence.outside), self.sigma)
        sigmas = np.concatenate([evidence.outside_sigmas, added])
        return replace(evidence, outside=outside, outside_sigmas=sigmas)

    def _places(self, fitted: FittedSuperquadric, grown: float = 1.0) -> Float64:
        surface = shape_of(fitted).mesh(self.resolution).vertices
        local = np.concatenate([grown * share * surface for share in _SHELLS])
        return np.asarray(local @ fitted.pose.rotation.T + fitted.pose.position, dtype=np.float64)

    def _overlapping(self, fitted: Sequence[FittedSuperquadric]) -> bool:
        places = [self._places(one) for one in fitted]
        return any(
            (_gauge(one, other) < 1).any()
            for k, one in enumerate(fitted)
            for other in _others(places, k)
        )


def _near(fitted: FittedSuperquadric, places: Float64) -> Float64:
    """Places that an object may come to contain in a few steps."""
    local = np.abs(in_frame_of(fitted, places))
    return np.asarray(places[(local < 1.5 * fitted.half_axes + _GROWTH).all(axis=1)])


def _others(places: Sequence[Float64], own: int) -> list[Float64]:
    return [points for k, points in enumerate(places) if k != own]


def _gauge(fitted: FittedSuperquadric, points: Float64) -> Float64:
    return shape_of(fitted).value(in_frame_of(fitted, points))
