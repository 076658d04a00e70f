"""Superquadrics of one scene fitted together: they don't penetrate each other."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.geometry import within
from scenefw.core.settings import COUNT, POSITIVE
from scenefw.fitting.placed import in_frame_of, shape_of, shells_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.random import Generator

    from scenefw.core.evidence import Evidence, FittedSuperquadric
    from scenefw.core.types import Float64
    from scenefw.fitting.superquadrics import Sizes, SuperquadricFit


class JointFit:
    """Fits each object alone, then again with the others outside of it (thesis 5.2.5).

    Hidden parts are what this decides: seen points of other objects lie outside from the start.
    The others begin as small cores and grow to their size, so that objects meet halfway.

    Args:
        single: fits objects one by one.
        rounds: how often all are fitted again.
        sigma: how deep a point of another may lie inside (m). It is large, so that
            this never outweighs what is seen of an object.

    Raises:
        ConfigError: a number below one, or a deviation that isn't positive.
    """

    def __init__(self, single: SuperquadricFit, rounds: int = 2, sigma: float = 0.02) -> None:
        COUNT.require(rounds=rounds)
        POSITIVE.require(sigma=sigma)
        self.single, self.rounds, self.sigma = single, rounds, sigma

    def fit(self, evidence: Sequence[Evidence]) -> list[FittedSuperquadric]:
        """The best superquadric for each, as if there were no others."""
        return self.single.fit(evidence)

    def separate(
        self, evidence: Sequence[Evidence], fits: Sequence[FittedSuperquadric]
    ) -> list[FittedSuperquadric]:
        """The best superquadrics such that none penetrates another.

        Args:
            evidence: about each object.
            fits: the best one of each, as if there were no others.
        """
        return self._separate(evidence, list(fits))

    def draws(
        self,
        evidence: Sequence[Evidence],
        fits: Sequence[FittedSuperquadric],
        count: int,
        generator: Generator,
    ) -> list[list[FittedSuperquadric]]:
        """Draws of what the superquadrics may be as well; they don't penetrate each other either.

        Args:
            evidence: about each object.
            fits: the best one of each, as if there were no others.
            count: of draws.
            generator: of random numbers, for other expected sizes.
        """
        draws = []
        for _ in range(count):
            sizes = self.single.sizes(len(evidence), generator)
            resized_fits = self.single.refit(evidence, fits, sizes)
            draws.append(self._separate(evidence, resized_fits, sizes))
        return draws

    def together(
        self, evidence: Sequence[Evidence], start: Sequence[FittedSuperquadric]
    ) -> list[FittedSuperquadric]:
        """Superquadrics near those, fitted again such that none penetrates another.

        Args:
            evidence: about each object.
            start: superquadrics that are nearly right.
        """
        return self._separate(evidence, self.single.refit(evidence, start))

    def _separate(
        self,
        evidence: Sequence[Evidence],
        fitted: list[FittedSuperquadric],
        sizes: Sizes | None = None,
    ) -> list[FittedSuperquadric]:
        """Fitted again until none penetrates another, or rounds are over."""
        for number in range(1, self.rounds + 1):
            shells = [shells_of(superquadric) for superquadric in fitted]
            if not _overlap(fitted, _place_shells(fitted, shells, 1.0)):
                break
            places = _place_shells(fitted, shells, number / self.rounds)
            joint_evidence = [
                self._add_outside(item, self._nearby(fitted[k], _other_points(places, k)))
                for k, item in enumerate(evidence)
            ]
            fitted = self.single.refit(joint_evidence, fitted, sizes)
        return fitted

    def _nearby(self, fitted: FittedSuperquadric, places: Float64) -> Float64:
        """Places that an object may come to contain in a few steps."""
        reach = 1.5 * fitted.half_axes + self.sigma
        return np.asarray(places[within(in_frame_of(fitted, places), -reach, reach)])

    def _add_outside(self, evidence: Evidence, points: Float64) -> Evidence:
        sigmas = np.concatenate([evidence.outside_sigmas, np.full(len(points), self.sigma)])
        outside = np.concatenate([evidence.outside, points])
        return replace(evidence, outside=outside, outside_sigmas=sigmas)


def _place_shells(
    fitted: Sequence[FittedSuperquadric], shells: Sequence[Float64], scale: float
) -> list[Float64]:
    """World coordinates of the shells of each, at a share of their size."""
    return [
        np.asarray(scale * shell @ item.pose.rotation.T + item.pose.position, dtype=np.float64)
        for item, shell in zip(fitted, shells, strict=True)
    ]


def _overlap(fitted: Sequence[FittedSuperquadric], places: Sequence[Float64]) -> bool:
    return any(
        (shape_of(item).value(in_frame_of(item, _other_points(places, k))) < 1).any()
        for k, item in enumerate(fitted)
    )


def _other_points(places: Sequence[Float64], index: int) -> Float64:
    """Places of all objects but one."""
    return np.concatenate([np.empty((0, 3)), *places[:index], *places[index + 1 :]])
