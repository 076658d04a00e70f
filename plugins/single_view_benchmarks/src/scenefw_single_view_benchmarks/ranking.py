"""What rankings of hypotheses are worth: the draw that each puts first, beside any and the best."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np
import torch

from scenefw.core.errors import ConfigError
from scenefw.core.settings import POSITIVE, at_least
from scenefw.data.batches.views import ViewMaker, Viewpoints
from scenefw.evaluation.scored_scenes import scored_scenes, workers_on
from scenefw.metrics.instances import instance_scores
from scenefw.metrics.occupancy import occupancy_iou
from scenefw.perception.estimate.assembly import scene_estimate
from scenefw.perception.observation.observation import Observation
from scenefw_several_views.scene_in_views import SceneInViews
from scenefw_single_view_benchmarks.displacement import displacement
from scenefw_single_view_benchmarks.ranking_results import (
    ANY,
    BEST,
    FIRST,
    RankingResult,
    ViewChoices,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from scenefw.core.protocols import (
        Engine,
        HypothesisRanking,
        MappingMethod,
        Noise,
        Renderer,
        Track,
    )
    from scenefw.core.types import Int32, SceneEstimate
    from scenefw.data.batches.stacks import SceneSet
    from scenefw.data.batches.views import ViewBatch
    from scenefw.evaluation.kept_rows import KeptRows
    from scenefw.perception.pipeline import ReconstructionPipeline
    from scenefw_simulators.body_maker import BodyMaker

_VIEWS, _CODES = 51, 52  # random streams
_DRAW = "draw"  # key in details that says which draw a scene is


class RankingEvaluation:
    """Scores the further hypothesis that each ranking puts first.

    Beside it stand the first hypothesis, which rankings leave where it is; any draw, as an order by
    chance would put first (the mean over draws); and the draw with the best instance IoU, for which
    one has to know the truth. Each draw is simulated to see how far its objects move.

    Args:
        scenes: of a split.
        method: reconstructs views, and draws.
        rankings: by name; None leaves one out.
        viewpoints: draws cameras.
        renderer: makes depth images of the truth.
        mapping: from depth to partial TSDF.
        engine: simulates.
        bodies: makes rigid bodies of objects.
        noise: disturbs the depth images.
        draws: of each view, beside the first hypothesis.
        steps: of a simulation at most; it ends when everything rests.
        furthest: an object counts as moved this far at most (m).
        seed: of cameras, noise and draws.
        device: where volumes and views are computed.
        kept: finished scenes of an interrupted run; None keeps none.

    Raises:
        ConfigError: fewer than two draws, a number that isn't positive, no ranking, or a method
            without a grid.
    """

    def __init__(
        self,
        scenes: SceneSet,
        method: ReconstructionPipeline,
        rankings: Mapping[str, HypothesisRanking | None],
        viewpoints: Viewpoints,
        renderer: Renderer,
        mapping: MappingMethod,
        engine: Engine,
        bodies: BodyMaker,
        noise: Mapping[str, Noise] | None = None,
        draws: int = 10,
        steps: int = 2400,
        furthest: float = 0.2,
        seed: int = 0,
        device: str = "cpu",
        kept: KeptRows | None = None,
    ) -> None:
        at_least(2).require(draws=draws)
        POSITIVE.require(steps=steps, furthest=furthest)
        self.rankings = {name: ranking for name, ranking in rankings.items() if ranking is not None}
        if not self.rankings:
            raise ConfigError("there is no ranking to score; give evaluation.rankings.NAME")
        if method.grid is None:
            raise ConfigError("the method has no grid; give evaluation.method.grid")
        self.scenes, self.method, self.grid = scenes, method, method.grid
        self.maker = ViewMaker(method.grid, viewpoints, renderer, mapping, noise)
        self.engine, self.bodies = engine, bodies
        self.draws, self.steps, self.furthest = draws, steps, furthest
        self.seed, self.device, self.kept = seed, device, kept

    def run(self, track: Track = lambda items, _: items) -> RankingResult:
        """Scores all scenes; `track(items, what)` shows a bar of the loop."""
        views = scored_scenes(
            self.score,
            len(self.scenes),
            lambda row: ViewChoices(**row),
            track,
            self.kept,
            workers_on(self.device, 1),  # a simulator has one world
            packed=asdict,
        )
        return RankingResult(tuple(views), tuple(self.rankings), self.draws)

    @torch.no_grad()
    def score(self, row: int) -> ViewChoices:
        """What each ranking puts first, of one view of a scene."""
        streams = (self.seed, _VIEWS, _CODES)
        scene_views = SceneInViews.of(self.scenes, row, self.maker, 1, streams, self.device)
        batch = scene_views.batches[0]
        generator = torch.Generator().manual_seed(scene_views.codes)
        samples = self.method.complete(batch.partial, self.grid, 1 + self.draws, generator)
        frame = Observation.of_partial(batch.partial, self.grid).frame
        scenes = [
            scene_estimate(sample, self.grid, frame, {}, {_DRAW: number})
            for number, sample in enumerate(samples)
        ]
        scores = [self._scores(scene, batch) for scene in scenes]
        draw_scores = scores[1:]
        choices = {
            FIRST: scores[0],
            ANY: {name: float(np.mean([draw[name] for draw in draw_scores])) for name in scores[0]},
            BEST: max(draw_scores, key=_instance_iou),
        }
        for name, ranking in self.rankings.items():
            second = ranking.rank(scenes)[1]
            choices[name] = scores[second.details[_DRAW]]
        return ViewChoices(scene_views.index, choices)

    def _scores(self, scene: SceneEstimate, batch: ViewBatch) -> dict[str, float]:
        true: Int32 = batch.volumes.instances[0].cpu().numpy()
        occupied = batch.volumes.tsdf[0, 0].cpu().numpy() < 0
        shift = displacement(scene, self.engine, self.bodies, self.steps, self.furthest)
        of_instances = instance_scores(scene.instances, true)
        return {
            "instance_iou": of_instances.iou,
            "panoptic_quality": of_instances.panoptic_quality,
            "occupancy_iou": occupancy_iou(scene.tsdf < 0, occupied),
            "displacement": shift.mean or 0.0,
        }


def _instance_iou(scores: Mapping[str, float]) -> float:
    return scores["instance_iou"]
