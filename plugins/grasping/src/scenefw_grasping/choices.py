"""Ways to choose one of many grasps, and what becomes of it in the true scene."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scenefw.core.types import Float64


@dataclass(frozen=True)
class Tried:
    """A grasp that was simulated in the predicted scene and in the true one.

    Args:
        label: of the predicted object.
        rank: its place in the ranking by simulation, 0 = first.
        top: how high the object reaches (m).
        neighbours: predicted objects that are near it.
        seal: of the cup, in [0, 1].
        outward: taken along the normal first.
        contact_visible: whether the camera saw the contact.
        predicted: disturbance in the predicted scene (m).
        disturbance: in the true one (m).
        max_shift: how far the other object moved that moved most there (m).
        failure: why the true object that the prediction stands for was not lifted, in words.
    """

    label: int
    rank: int
    top: float
    neighbours: int
    seal: float
    outward: bool
    contact_visible: bool
    predicted: float
    disturbance: float
    max_shift: float
    failure: str = ""

    @property
    def lifted(self) -> bool:
        """Whether the object that was meant was lifted."""
        return not self.failure

    def scores(self, still: float) -> Float64:
        """Disturbance (m), 1 if the lift failed, 1 if it succeeded and nothing moved by `still`."""
        clean = self.lifted and self.max_shift < still
        return np.array([self.disturbance, float(not self.lifted), float(clean)])


Choice = Callable[[Sequence[Tried]], Tried]


def _by_rank(tries: Sequence[Tried]) -> Tried:
    return min(tries, key=lambda grasp: grasp.rank)


def _topmost(tries: Sequence[Tried]) -> Tried:
    return max(
        tries, key=lambda grasp: (round(grasp.top, 6), not grasp.outward, grasp.seal, -grasp.rank)
    )


def _least_neighbours(tries: Sequence[Tried]) -> Tried:
    return max(
        tries,
        key=lambda grasp: (
            -grasp.neighbours,
            round(grasp.top, 6),
            not grasp.outward,
            grasp.seal,
            -grasp.rank,
        ),
    )


def _best_seal(tries: Sequence[Tried]) -> Tried:
    return max(tries, key=lambda grasp: (not grasp.outward, grasp.seal, -grasp.rank))


def _oracle(tries: Sequence[Tried]) -> Tried:
    return min(tries, key=lambda grasp: (not grasp.lifted, grasp.disturbance))


CHOSEN, MEAN, TOPMOST, ORACLE = "chosen", "mean", "topmost", "oracle"
"""The first of the ranking; all, on average; the best reference; the best in the true scene."""

OF_A_SCENE: Mapping[str, Choice | None] = {
    CHOSEN: _by_rank,
    TOPMOST: _topmost,
    "least_neighbours": _least_neighbours,
    "best_seal": _best_seal,
    MEAN: None,
    ORACLE: _oracle,
}
"""Choices among the grasps of a scene; None = the mean of all."""

OF_AN_OBJECT: Mapping[str, Choice | None] = {
    CHOSEN: _by_rank,
    "best_seal": _best_seal,
    MEAN: None,
    ORACLE: _oracle,
}
"""Choices among the grasps of one object."""


def score(choice: Choice | None, tries: Sequence[Tried], still: float) -> Float64:
    """Scores (3,) of a choice, as `Tried.scores`."""
    if choice is not None:
        return choice(tries).scores(still)
    return np.asarray(np.mean([grasp.scores(still) for grasp in tries], axis=0))
