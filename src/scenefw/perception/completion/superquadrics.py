"""Superquadrics of visible objects; what is hidden follows from what is expected of sizes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from scenefw.perception.steps import ObjectSet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.evidence import FittedSuperquadric
    from scenefw.core.protocols import ShapeFit
    from scenefw.core.types import GridSpec
    from scenefw.perception.evidence.tolerances import Tolerances
    from scenefw.perception.observation.observation import ViewGeometry
    from scenefw.perception.steps import Fits


class FitSampling:
    """Takes the superquadrics that explain the view, none of which penetrates another.

    Further hypotheses are fitted with other expected sizes, so they vary where the image is silent.
    It learns nothing. An object that no superquadric explains, or only one in free space, keeps its
    rough volume.

    Args:
        fit: of superquadrics to evidence.
        tolerances: say which superquadrics explain their objects.
        drawn: without it, all hypotheses are the best fit.
    """

    grid: GridSpec | None = None

    def __init__(self, fit: ShapeFit, tolerances: Tolerances, *, drawn: bool = True) -> None:
        self.fit, self.tolerances, self.drawn = fit, tolerances, drawn
        self.metadata: dict[str, Any] = {}  # of no checkpoint

    def complete(
        self, fits: Fits, view: ViewGeometry, samples: int, generator: torch.Generator
    ) -> list[ObjectSet]:
        """The best fit of each object, and then draws of what they may be as well."""
        evidence, superquadrics = list(fits.evidence.values()), list(fits.superquadrics.values())
        shapes = [self.fit.separate(evidence, superquadrics)]
        if self.drawn:
            random = np.random.default_rng(int(torch.randint(2**62, (1,), generator=generator)))
            shapes += self.fit.draws(evidence, superquadrics, samples - 1, random)
        return [accepted(fits, hypothesis, self.tolerances, view) for hypothesis in shapes]


def accepted(
    fits: Fits, shapes: Sequence[FittedSuperquadric], tolerances: Tolerances, view: ViewGeometry
) -> ObjectSet:
    """A hypothesis with the superquadrics that explain what is visible.

    Args:
        fits: the objects and the evidence about them.
        shapes: one for each object with evidence, with its distances from it.
        tolerances: say which explain it.
        view: that shows the objects.
    """
    shape_of = {
        label: shape
        for (label, evidence), shape in zip(fits.evidence.items(), shapes, strict=True)
        if tolerances.accept(shape, evidence, view)
    }
    return ObjectSet(fits.objects, shape_of, evidence=fits.evidence)
