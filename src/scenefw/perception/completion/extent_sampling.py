"""Superquadrics whose hidden extents a trained network samples, of all objects jointly."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import torch

from scenefw.core.settings import COUNT, NOT_NEGATIVE, above
from scenefw.data.batches.view_samples import ObjectSamples
from scenefw.fitting.placed import signed_distance
from scenefw.perception.completion.extent_inputs import ExtentInputs
from scenefw.perception.completion.support import extend_shells, extend_to_support
from scenefw.perception.evidence.pseudo_observations import add_predicted_surface
from scenefw.perception.steps import ObjectSet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.random import Generator

    from scenefw.core.evidence import Evidence, FittedSuperquadric
    from scenefw.core.protocols import ShapeFit
    from scenefw.core.set_flows import SetFlowBatch
    from scenefw.core.training_protocols import SetFlowModel, Trained
    from scenefw.core.types import GridSpec
    from scenefw.perception.evidence.tolerances import Tolerances
    from scenefw.perception.observation.observation import Observation, ViewGeometry
    from scenefw.perception.steps import Fits, HiddenObjectSampling, ShellSampling

    Shapes = Sequence[FittedSuperquadric]


class ExtentSampling:
    """Samples how far objects go on where they are hidden, and fits them again (flow matching).

    A network samples the hidden extents of all objects jointly, from a random subset of their
    visible points per sample. What would hang in the air goes on to what is below it, and what
    would sink into the floor ends there. Points of a sampled surface that lie away from all that is
    visible of its object are pseudo-observations: all objects are fitted again, so measurements
    decide where there are some. An object that then lies in free space is taken as it was fitted
    without the network. The first hypothesis is the median of several samples.

    Args:
        fit: of superquadrics to evidence.
        tolerances: say which superquadrics explain their objects.
        checkpoint: of a flow of sets that samples extents.
        steps: of each sample.
        median_of: samples whose median the first hypothesis takes; 0: the fit without a network.
        spread: standard deviation of the noise that further samples start from; 1 as in training.
            Samples are fitted to the view again, which makes hypotheses more alike than samples.
        pseudo_sigma: standard deviation of points of sampled surfaces (m).
        min_gap: points of sampled surfaces count that are further than this from all visible ones
            (m).
        hidden: adds objects of which nothing is visible to further hypotheses; None adds none.
        shells: adds other shapes of objects, of which the assembly takes the more probable one;
            None adds none.

    Raises:
        ConfigError: a number that isn't positive.
    """

    grid: GridSpec | None = None

    def __init__(
        self,
        fit: ShapeFit,
        tolerances: Tolerances,
        checkpoint: Trained[SetFlowModel],
        steps: int,
        median_of: int,
        spread: float,
        pseudo_sigma: float,
        min_gap: float,
        hidden: HiddenObjectSampling | None = None,
        shells: ShellSampling | None = None,
    ) -> None:
        COUNT.require(steps=steps)
        NOT_NEGATIVE.require(median_of=median_of, min_gap=min_gap, spread=spread)
        certain = above(tolerances.point_sigma, "as what is measured is the more certain")
        certain.require(pseudo_sigma=pseudo_sigma)
        self.fit, self.tolerances = fit, tolerances
        self.model, self.hidden, self.shells = checkpoint.model, hidden, shells
        self.steps, self.median_of, self.spread = steps, median_of, spread
        self.pseudo_sigma, self.min_gap = pseudo_sigma, min_gap
        self.metadata = dict(checkpoint.metadata)
        if shells is not None:
            self.metadata["shells"] = dict(shells.metadata)

    def complete(
        self, fits: Fits, view: Observation, samples: int, generator: torch.Generator
    ) -> list[ObjectSet]:
        """The median of samples, and then further ones; in these also objects that nobody sees."""
        sets = self._superquadrics(fits, view, samples, generator)
        if self.shells is None:
            return sets
        sets = self.shells.beside(sets, view, generator)
        return [extend_shells(hypothesis, view) for hypothesis in sets]

    def _superquadrics(
        self, fits: Fits, view: Observation, samples: int, generator: torch.Generator
    ) -> list[ObjectSet]:
        random = np.random.default_rng(int(torch.randint(2**62, (1,), generator=generator)))
        if not fits.evidence:
            return [ObjectSet(fits.objects, {})] * samples
        evidence, superquadrics = list(fits.evidence.values()), list(fits.superquadrics.values())
        rows = max(self.median_of + samples - 1, 1)
        seen_objects = ExtentInputs(  # in each row by other points
            view, fits.objects.pixels, list(fits.evidence), superquadrics, random,
            self.tolerances.inlier_distance, rows, ObjectSamples.of(self.metadata),
        )  # fmt: skip
        world_sets = seen_objects.in_world(self._draw(seen_objects, superquadrics, rows, random))
        fallbacks = self._supported_shapes(superquadrics, evidence, view)
        sets = []
        for number in range(samples):
            if number == 0 and not self.median_of:
                shapes: Shapes = self.fit.together(evidence, superquadrics)
            else:
                row = self.median_of + number - 1
                selection = slice(row, row + 1) if number else slice(self.median_of)
                shapes = self._refit(world_sets.middle(selection, superquadrics), evidence, view)
            shapes = self._supported_shapes(shapes, evidence, view)
            hypothesis = self._accept(fits, shapes, fallbacks, view)
            if self.hidden is not None and number > 0:
                hypothesis = self._add_hidden(hypothesis, shapes, seen_objects, view, random)
            sets.append(hypothesis)
        return sets

    @torch.no_grad()
    def _draw(
        self, seen_objects: ExtentInputs, superquadrics: Shapes, rows: int, random: Generator
    ) -> SetFlowBatch:
        generator = torch.Generator().manual_seed(int(random.integers(2**62)))
        device = next(self.model.parameters()).device  # type: ignore[attr-defined]
        spread = [1.0] * self.median_of + [self.spread] * (rows - self.median_of)
        batch = seen_objects.batch(superquadrics, device)
        return self.model.sample(batch, rows, generator, self.steps, spread[:rows])

    def _refit(
        self, shapes: Shapes, evidence: Sequence[Evidence], view: ViewGeometry
    ) -> list[FittedSuperquadric]:
        """Superquadrics that explain what is visible, and are as sampled where nothing is."""
        shapes = extend_to_support(shapes, view.clear, view.grid)
        extended_evidence = [
            add_predicted_surface(object_evidence, shape, self.pseudo_sigma, self.min_gap)
            for object_evidence, shape in zip(evidence, shapes, strict=True)
        ]
        return self.fit.together(extended_evidence, shapes)

    @staticmethod
    def _supported_shapes(
        shapes: Shapes, evidence: Sequence[Evidence], view: ViewGeometry
    ) -> list[FittedSuperquadric]:
        """Shapes that stand, with their distances from what is visible of them."""
        return [
            replace(shape, distances=signed_distance(shape, object_evidence.points))
            for shape, object_evidence in zip(
                extend_to_support(shapes, view.clear, view.grid), evidence, strict=True
            )
        ]

    def _accept(
        self, fits: Fits, shapes: Shapes, fallbacks: Shapes, view: ViewGeometry
    ) -> ObjectSet:
        """Each object as it was sampled, else as fitted without, if that agrees with the view."""
        shape_of = {}
        for (label, evidence), *candidates in zip(
            fits.evidence.items(), shapes, fallbacks, strict=True
        ):
            for shape in candidates:
                if self.tolerances.accept(shape, evidence, view):
                    shape_of[label] = shape
                    break
        return ObjectSet(fits.objects, shape_of, evidence=fits.evidence)

    def _add_hidden(
        self,
        hypothesis: ObjectSet,
        shapes: Shapes,
        seen_objects: ExtentInputs,
        view: Observation,
        random: Generator,
    ) -> ObjectSet:
        """The hypothesis with objects that the view hides wholly."""
        if self.hidden is None or hypothesis.superquadrics is None:
            return hypothesis
        objects, shape_of = hypothesis.objects, dict(hypothesis.superquadrics)
        visible = [
            shape_of.get(label, shape)
            for label, shape in zip(hypothesis.evidence, shapes, strict=True)
        ]
        labels = [objects.pixels, *([] if objects.instances is None else [objects.instances])]
        first = 1 + max(int(image.max(initial=0)) for image in labels)
        shape_of |= dict(enumerate(self.hidden.beside(visible, seen_objects, view, random), first))
        return replace(hypothesis, superquadrics=shape_of)
