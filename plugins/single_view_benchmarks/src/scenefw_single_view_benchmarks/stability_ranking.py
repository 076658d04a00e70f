"""Hypotheses in an order that also asks whether they would stand."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from scenefw.core.settings import COUNT, POSITIVE
from scenefw_single_view_benchmarks.displacement import displacement

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.protocols import Engine
    from scenefw.core.types import SceneEstimate
    from scenefw.perception.ranking.by_evidence import EvidenceRanking
    from scenefw_simulators.body_maker import BodyMaker


class StabilityRanking:
    """Adds to the evidence how far objects move when they are left to gravity (group `ranking`).

    The score is the deviation of `EvidenceRanking` plus the mean displacement of the objects in
    units of `unit`; the least comes next after the first scene, the most typical one, which stays
    the first. What is no solid can't be simulated and counts as moved by `max_displacement`. Scenes
    stay as they are: `settling=physics` lets objects come to rest.

    `experiment=ranking` compares what comes first with evidence alone.

    `details["stability"]` of each scene has `displacement` (m), None where there is no object, and
    `left_out`, the number of objects that are no solid.

    Args:
        evidence: how well each scene explains the image.
        engine: simulates.
        bodies: makes rigid bodies of the objects.
        steps: of the simulation at most; it ends when everything rests.
        unit: a displacement that counts as one standard deviation of depth (m).
        max_displacement: an object counts as moved this far at most (m).

    Raises:
        ConfigError: a number that isn't positive.
    """

    def __init__(
        self,
        evidence: EvidenceRanking,
        engine: Engine,
        bodies: BodyMaker,
        steps: int = 2400,
        unit: float = 0.06,
        max_displacement: float = 0.2,
    ) -> None:
        COUNT.require(steps=steps)
        POSITIVE.require(unit=unit, max_displacement=max_displacement)
        self.evidence, self.engine, self.bodies = evidence, engine, bodies
        self.steps, self.unit, self.max_displacement = steps, unit, max_displacement

    def rank(self, scenes: Sequence[SceneEstimate]) -> list[SceneEstimate]:
        """The scenes of one image: the first, then what explains it best and stands."""
        candidates = [self._with_stability(scene) for scene in self.evidence.rank(scenes)]
        return candidates[:1] + sorted(candidates[1:], key=self._score)

    def _with_stability(self, scene: SceneEstimate) -> SceneEstimate:
        movement = displacement(scene, self.engine, self.bodies, self.steps, self.max_displacement)
        facts = {"displacement": movement.mean, "left_out": movement.left_out}
        return replace(scene, details={**scene.details, "stability": facts})

    def _score(self, scene: SceneEstimate) -> float:
        deviation = scene.details["evidence"]["deviation"]
        mean_displacement = scene.details["stability"]["displacement"]
        # no object, or none where the image looks: last
        if deviation is None or mean_displacement is None:
            return float("inf")
        return float(deviation) + float(mean_displacement) / self.unit
