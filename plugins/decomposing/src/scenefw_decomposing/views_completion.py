"""Superquadrics that explain several views at once (thesis eqs 5.8 to 5.12, 5.3)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.perception.completion.superquadrics import accepted
from scenefw.perception.completion.support import extend_to_support
from scenefw.perception.observation.floor_noise import MAX_FLOOR_HEIGHT
from scenefw.shapes.superquadric import support_points

if TYPE_CHECKING:
    import torch

    from scenefw.core.evidence import FittedSuperquadric
    from scenefw.core.protocols import ShapeFit
    from scenefw.core.types import GridSpec
    from scenefw.perception.evidence.tolerances import Tolerances
    from scenefw.perception.observation.views import Views
    from scenefw.perception.steps import Fits, ObjectSet


class ViewsCompletion:
    """Takes the superquadrics that explain all views, none of which penetrates another.

    An object that no superquadric explains in all views keeps its volume. What is mostly
    below the floor, or ends hardly above it, is noise of the floor and goes.

    Args:
        fit: of superquadrics to evidence.
        tolerances: say which superquadrics explain their objects, and what is the floor.
    """

    grid: GridSpec | None = None

    def __init__(self, fit: ShapeFit, tolerances: Tolerances) -> None:
        self.fit, self.tolerances = fit, tolerances
        self.metadata: dict[str, Any] = {}  # of no checkpoint

    def complete(
        self, fits: Fits, view: Views, samples: int, generator: torch.Generator
    ) -> list[ObjectSet]:
        """`samples` times the same objects."""
        evidence, superquadrics = list(fits.evidence.values()), list(fits.superquadrics.values())
        shapes = self.fit.separate(evidence, superquadrics) if evidence else []
        hypothesis = accepted(fits, shapes, self.tolerances, view)
        return [self._above_floor(hypothesis, view)] * samples

    def _above_floor(self, hypothesis: ObjectSet, view: Views) -> ObjectSet:
        """The hypothesis without objects that are noise of the floor."""
        shape_of_label = {
            k: _out_of_floor(shape, view) for k, shape in (hypothesis.superquadrics or {}).items()
        }
        sunk = [k for k, shape in shape_of_label.items() if _is_sunk(shape)]
        objects = hypothesis.objects
        if objects.instances is not None:
            instances = np.where(np.isin(objects.instances, sunk), 0, objects.instances)
            objects = replace(objects, instances=instances)
        return replace(
            hypothesis,
            objects=objects,
            superquadrics={k: shape for k, shape in shape_of_label.items() if k not in sunk},
            evidence={k: item for k, item in hypothesis.evidence.items() if k not in sunk},
        )


def _out_of_floor(superquadric: FittedSuperquadric, view: Views) -> FittedSuperquadric:
    """What reaches below the floor's noise, as a fit to a shape it isn't may, ends at the floor."""
    return (
        extend_to_support([superquadric], view.free, view.grid)[0]
        if _heights(superquadric)[0] < -MAX_FLOOR_HEIGHT
        else superquadric
    )


def _is_sunk(superquadric: FittedSuperquadric) -> bool:
    """Whether more of it is below the floor than above, or all of it in the floor's noise."""
    return bool(superquadric.pose.position[2] < 0 or _heights(superquadric)[1] < MAX_FLOOR_HEIGHT)


def _heights(superquadric: FittedSuperquadric) -> tuple[float, float]:
    """Lowest and highest point over the floor (m)."""
    up, middle = superquadric.pose.rotation[2], superquadric.pose.position[2]
    top = support_points(superquadric.half_axes, superquadric.exponents, up) @ up
    return float(middle - top), float(middle + top)
