"""Hypotheses in an order that also asks whether they would stand."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.settings import COUNT, POSITIVE
from scenefw.scenes.simulation import motions

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.protocols import Engine
    from scenefw.core.types import SceneEstimate
    from scenefw.perception.bodies import BodyMaker
    from scenefw.perception.ranked_by_evidence import RankedByEvidence


class RankedByStability:
    """Adds to the evidence how far objects move when they are left to gravity (group `ranking`).

    The score is the deviation of `RankedByEvidence` plus the mean displacement of the objects in
    units of `unit`; the least comes next after the first scene, the most typical one, which stays
    the first. What is no solid can't be simulated and counts as moved by `furthest`. Scenes stay as
    they are: `settling=physics` lets objects come to rest.

    On 72 validation views with noise of a Kinect, ten draws each, the draw that comes first has
    instance IoU 0.838 and occupancy IoU 0.903 (by evidence alone 0.837 and 0.895; draws in the mean
    0.800 and 0.860), and its objects move by 2.9 mm (4.8).

    `details["stability"]` of each scene has `displacement` (m), None where there is no object, and
    `left_out`, the number of objects that are no solid.

    Args:
        evidence: how well each scene explains the image.
        engine: simulates.
        bodies: makes rigid bodies of the objects.
        steps: of the simulation at most; it ends when everything rests.
        unit: a displacement that counts as one standard deviation of depth (m).
        furthest: an object counts as moved this far at most (m).

    Raises:
        ConfigError: a number that isn't positive.
    """

    def __init__(
        self,
        evidence: RankedByEvidence,
        engine: Engine,
        bodies: BodyMaker,
        steps: int = 2400,
        unit: float = 0.1,
        furthest: float = 0.2,
    ) -> None:
        COUNT.require(steps=steps)
        POSITIVE.require(unit=unit, furthest=furthest)
        self.evidence, self.engine, self.bodies = evidence, engine, bodies
        self.steps, self.unit, self.furthest = steps, unit, furthest

    def rank(self, scenes: Sequence[SceneEstimate]) -> list[SceneEstimate]:
        """The scenes of one image: the first, then what explains it best and stands."""
        judged = [self._judged(one) for one in self.evidence.rank(scenes)]
        return judged[:1] + sorted(judged[1:], key=self._score)

    def _judged(self, scene: SceneEstimate) -> SceneEstimate:
        meshes = {item.id: item.mesh for item in scene.objects}
        placed = {item.id: item.placed for item in scene.objects if item.placed is not None}
        bodies = self.bodies.make(meshes, placed)
        found = motions(list(bodies.bodies.values()), self.engine, self.steps, until_rest=True)
        shifts = [min(one.shift, self.furthest) for one in found]
        shifts += [self.furthest] * len(bodies.left_out)
        facts = {
            "displacement": float(np.mean(shifts)) if shifts else None,
            "left_out": len(bodies.left_out),
        }
        return replace(scene, details={**scene.details, "stability": facts})

    def _score(self, scene: SceneEstimate) -> float:
        deviation = scene.details["evidence"]["deviation"]
        moved = scene.details["stability"]["displacement"]
        if deviation is None or moved is None:  # no object, or none where the image looks: last
            return float("inf")
        return float(deviation) + float(moved) / self.unit
