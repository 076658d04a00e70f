"""Superquadrics of a view whose hidden parts a trained flow of sets draws."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

import numpy as np
import torch

from scenefw.core.settings import COUNT, NOT_NEGATIVE, above
from scenefw.data.view_samples import ObjectSamples
from scenefw.fitting.placed import signed_distance
from scenefw.perception.completion.extent_inputs import SeenObjects
from scenefw.perception.completion.superquadrics import Fitted
from scenefw.perception.completion.support import standing
from scenefw.perception.evidence.pseudo_observations import with_supposed
from scenefw.perception.observation.free_space import surely_free

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.random import Generator

    from scenefw.core.evidence import Evidence, FittedSuperquadric
    from scenefw.core.set_flows import SeenSetBatch
    from scenefw.core.training_protocols import TrainedSetFlow
    from scenefw.perception.completion.hidden_objects import HiddenObjects
    from scenefw.perception.completion.vessels import Vessels
    from scenefw.perception.evidence.gathering import EvidenceOfView, View
    from scenefw.perception.grouping.relabelling import Completing
    from scenefw.perception.segmentation.edge_restoration import RestoredEdges
    from scenefw.postprocessing.confidence import Calibration


class SizedFit(Protocol):
    """A fit of objects, alone and then with expected sizes."""

    def fit(self, evidence: Sequence[Evidence]) -> list[FittedSuperquadric]:
        """The best superquadric for each."""

    def draws(
        self, evidence: Sequence[Evidence], count: int, generator: Generator
    ) -> list[list[FittedSuperquadric]]:
        """The best superquadrics, and then draws of what they may be as well."""

    def alone(self, evidence: Sequence[Evidence]) -> list[FittedSuperquadric]:
        """The best superquadric for each, as if there were no others."""

    def together(
        self, evidence: Sequence[Evidence], start: Sequence[FittedSuperquadric]
    ) -> list[FittedSuperquadric]:
        """Superquadrics near those, fitted again such that none penetrates another."""


class DrawnSets(Fitted):
    """Superquadrics fitted to the view, and to draws of a network where nothing is seen.

    Objects that the image shows are fitted (`Fitted`). The network sees their points, for each draw
    others, and draws how far each of them goes on. What would hang in the air goes on to what is
    below it, and what would sink into the floor ends there (`standing`). Points of a drawn surface
    that lie away from all that is seen of its object are evidence about it as well. All are fitted
    again, from what was drawn, so that what is seen decides where it speaks; an object that then
    lies where the view sees through is taken as it was fitted alone. For the first sample
    the faces and exponents of objects are in the middle of several draws. Objects of which nothing
    is seen are drawn by `hidden`.

    Args:
        inner: makes the scenes.
        fit: of superquadrics to evidence.
        evidence: what a view says about an object.
        checkpoint: of a flow of sets.
        near: seen points up to this far from the surface are explained (m).
        explained: share of seen points that a superquadric must explain to be taken.
        least: seen points that an object must have to be fitted.
        lowest: how high above the floor what was not predicted must reach to be an object (m).
        steps: of each draw.
        votes: draws whose middle the first sample takes; 0: it is the fit without a network.
        spread: standard deviation of the noise that further samples start from; 1 as in training.
            What is drawn is fitted to the view again, which makes samples more alike than draws.
        drawn_sigma: standard deviation of points of drawn surfaces (m).
        beyond: points of drawn surfaces count that are further than this from all seen ones (m).
        hidden: adds objects of which nothing is seen to drawn scenes; None adds none.
        calibration: from how alike samples are to how right objects are; None: not measured.
        vessels: says which objects are hollow; None: none are.
        edges: restores those of the images first; None: images stay as they are.
        drawn: the first sample is the best, further ones are drawn; without it, all are the best.

    Raises:
        ConfigError: a number that isn't positive.
    """

    def __init__(
        self,
        inner: Completing,
        fit: SizedFit,
        evidence: EvidenceOfView,
        checkpoint: TrainedSetFlow,
        near: float = 0.006,
        explained: float = 0.75,
        least: int = 60,
        lowest: float = 0.015,
        steps: int = 20,
        votes: int = 32,
        spread: float = 1.0,
        drawn_sigma: float = 0.008,
        beyond: float = 0.01,
        hidden: HiddenObjects | None = None,
        calibration: Calibration | None = None,
        vessels: Vessels | None = None,
        edges: RestoredEdges | None = None,
        *,
        drawn: bool = True,
    ) -> None:
        super().__init__(
            inner, fit, evidence, near, explained, least, lowest, vessels, edges, drawn=drawn
        )
        COUNT.require(steps=steps)
        NOT_NEGATIVE.require(votes=votes, beyond=beyond, spread=spread)
        above(evidence.seen_sigma, "as what is seen is the more certain").require(
            drawn_sigma=drawn_sigma
        )
        self.sized, self.model, self.hidden = fit, checkpoint.model, hidden
        self.steps, self.votes, self.spread = steps, votes, spread
        self.drawn_sigma, self.beyond = drawn_sigma, beyond
        self.calibration = calibration
        self.metadata = dict(checkpoint.metadata)

    def superquadrics(
        self, view: View, count: int = 1, random: Generator | None = None
    ) -> list[dict[int, FittedSuperquadric]]:
        """Objects that a superquadric explains, by label; in draws also those that nobody sees.

        Args:
            view: with the predicted volumes.
            count: of results: the best one, then draws.
            random: for the draws.
        """
        random = np.random.default_rng(0) if random is None else random
        enough = self._enough(view)
        if not enough:
            return [{} for _ in range(count)]
        given = list(enough.values())
        alone = self.sized.alone(given)
        rows = max(self.votes + count - 1, 1)
        seen = SeenObjects(  # each draw sees other points
            view, list(enough), alone, random, rows, ObjectSamples.of(self.metadata)
        )
        draws = seen.in_world(self._draw(seen, alone, rows, random))
        clear = surely_free(view)
        plain, results = self._standing(alone, given, clear), []
        for number in range(count):
            row = self.votes + number - 1
            if number == 0 and not self.votes:
                found = self.sized.together(given, alone)
            else:
                taken = slice(row, row + 1) if number else slice(self.votes)
                found = self._near(standing(draws.middle(taken, alone), clear), given)
            found = self._standing(found, given, clear)
            kept = self._kept(found, plain, enough, clear)
            if self.hidden is not None and number > 0:
                known = [kept.get(label, one) for label, one in zip(enough, found, strict=True)]
                first = int(max(view.instances.max(initial=0), view.masks.max(initial=0))) + 1
                kept |= dict(enumerate(self.hidden.beside(known, seen, view, random), first))
            results.append(kept)
        return results

    @torch.no_grad()
    def _draw(
        self,
        seen: SeenObjects,
        fitted: Sequence[FittedSuperquadric],
        count: int,
        random: Generator,
    ) -> SeenSetBatch:
        generator = torch.Generator().manual_seed(int(random.integers(2**62)))
        device = next(self.model.parameters()).device  # type: ignore[attr-defined]
        spread = [1.0] * self.votes + [self.spread] * (count - self.votes)
        return self.model.sample(
            seen.batch(fitted, device), count, generator, self.steps, spread[:count]
        )

    def _near(
        self, drawn: Sequence[FittedSuperquadric], evidence: Sequence[Evidence]
    ) -> list[FittedSuperquadric]:
        """Superquadrics that explain what is seen, and are as drawn where nothing is."""
        expected = [self._expected(*both) for both in zip(evidence, drawn, strict=True)]
        return self.sized.together(expected, drawn)

    @staticmethod
    def _standing(
        objects: Sequence[FittedSuperquadric], evidence: Sequence[Evidence], view: View
    ) -> list[FittedSuperquadric]:
        """Objects that stand, with their distances from what is seen of them."""
        return [
            replace(one, distances=signed_distance(one, given.points))
            for one, given in zip(standing(objects, view), evidence, strict=True)
        ]

    def _expected(self, evidence: Evidence, drawn: FittedSuperquadric) -> Evidence:
        return with_supposed(evidence, self._seen(evidence), drawn, self.drawn_sigma, self.beyond)

    def _kept(
        self,
        found: Sequence[FittedSuperquadric],
        alone: Sequence[FittedSuperquadric],
        enough: Mapping[int, Evidence],
        view: View,
    ) -> dict[int, FittedSuperquadric]:
        """Each object as it was drawn, else as fitted alone, if that agrees with what is seen."""
        kept = {}
        for label, one, plain in zip(enough, found, alone, strict=True):
            if self._agrees(one, enough[label], view):
                kept[label] = one
            elif self._agrees(plain, enough[label], view):
                kept[label] = plain
        return kept
