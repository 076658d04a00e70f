"""Decomposition of test scenes into objects (thesis tables 6.1 and 6.2, figs 6.6 to 6.11)."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import torch
from sklearn.metrics import adjusted_rand_score

from scenefw.core import rng
from scenefw.core.errors import ConfigError
from scenefw.data.batches.object_sets import object_set_batch
from scenefw.data.batches.views import ViewMaker
from scenefw.evaluation.sets.methods import Decomposer, FoundSet, SeenSet
from scenefw.evaluation.sets.published import ROWS
from scenefw.evaluation.sets.results import (
    DecomposedScene,
    DecompositionResult,
    SceneCodes,
    SetExample,
)
from scenefw.kernels.cameras import camera_of
from scenefw.losses.set_bce import SetBinaryCrossEntropy
from scenefw.matching.object_sets import matched_objects
from scenefw.metrics.decomposition import decomposition_scores, found_objects

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from scenefw.core.object_sets import ObjectSetBatch
    from scenefw.core.protocols import MappingMethod, Matching, Noise, SurfaceRenderer, Track
    from scenefw.core.types import GridSpec
    from scenefw.data.batches.stacks import StackScenes
    from scenefw.data.batches.views import ViewBatch, Viewpoints

_VIEWS, _DRAWS = 1, 3  # random streams
_ERRORS = ("missing", "joined", "duplicate", "split")


class DecompositionEvaluation:
    """Scores methods on test scenes, all on the same ones, each seen once.

    Args:
        scenes: of the test split.
        methods: by name; the first is the main one, the second the strongest that learns nothing.
            None leaves one out. The grid is that of the first that has one.
        viewpoints: draws cameras.
        renderer: makes depth images of the true TSDF.
        mapping: from depth to partial TSDF.
        noise: disturbs the depth images.
        matching: of predictions to objects by IoU.
        published: which row of the thesis's tables stands beside; None = none.
        examples: scenes that are drawn.
        grid: if no method has its own.
        enough: pixels from which on an object counts as seen.
        seed: of cameras, noise and draws.
        device: where volumes and views are computed.

    Raises:
        ConfigError: no method has a grid, or no such row.
    """

    def __init__(
        self,
        scenes: StackScenes,
        methods: Mapping[str, Decomposer | None],
        viewpoints: Viewpoints,
        renderer: SurfaceRenderer,
        mapping: MappingMethod,
        noise: Mapping[str, Noise] | None = None,
        matching: Matching | None = None,
        published: str | None = None,
        examples: int = 4,
        grid: GridSpec | None = None,
        enough: int = 200,
        seed: int = 0,
        device: str = "cpu",
    ) -> None:
        self.methods = {name: method for name, method in methods.items() if method is not None}
        method_grids = (method.grid for method in self.methods.values())
        grids = [candidate for candidate in (*method_grids, grid) if candidate is not None]
        if not grids:
            raise ConfigError(
                "no method of the evaluation has a grid; give a trained network (checkpoint=FILE) "
                "or evaluation.grid=${grid}"
            )
        if published is not None and published not in ROWS:
            raise ConfigError(
                f"evaluation.published is {published}; expected {', '.join(ROWS)} or null"
            )
        self.grid = grids[0]
        self.scenes, self.matching, self.published = scenes, matching, published
        self.maker = ViewMaker(self.grid, viewpoints, renderer, mapping, noise)
        self.renderer, self.enough = renderer, enough
        self.examples, self.seed, self.device = examples, seed, device

    def run(self, track: Track = lambda items, _: items) -> DecompositionResult:
        """Scores all scenes; `track(items, what)` shows a bar of the loop."""
        scenes: list[DecomposedScene] = []
        examples: list[SetExample] = []
        for number in track(range(len(self.scenes)), "test scenes"):
            scene, example = self.look(number)
            scenes.append(scene)
            if len(examples) < self.examples:
                examples.append(example)
        return DecompositionResult(
            tuple(scenes), tuple(self.methods), self.published, tuple(examples)
        )

    @torch.no_grad()
    def look(self, number: int) -> tuple[DecomposedScene, SetExample]:
        """What all methods make of one scene of the split, in figures and as labels."""
        parameters = self.scenes.parameters([number], self.device)
        view = self.maker.make_one(parameters, rng.generator(self.seed, _VIEWS, number))
        batch = object_set_batch(view, self.grid)
        decompositions = {}
        for name, method in self.methods.items():
            draws = torch.Generator().manual_seed(rng.torch_seed(self.seed, _DRAWS, number))
            decompositions[name] = method.decompose(
                SeenSet(batch, view.volumes.tsdf, view.partial, self.grid, draws)
            )
        index = int(self.scenes.indices[number])
        codes = _codes(next(iter(decompositions.values())))
        visible_labels = self._visible_labels(view, batch)
        scores = {
            name: self._scores(decomposition, batch, visible_labels)
            for name, decomposition in decompositions.items()
        }
        labels = {"truth": batch.instances[0].cpu().numpy().astype(np.int64)}
        labels |= {name: decomposition.labels for name, decomposition in decompositions.items()}
        objects = int(batch.present.sum())
        camera, depth = camera_of(view.cameras, 0), view.depth[0].cpu().numpy()
        return (
            DecomposedScene(index, objects, scores, codes, hidden=objects - len(visible_labels)),
            SetExample(index, self.grid, camera, depth, labels),
        )

    def _visible_labels(self, view: ViewBatch, batch: ObjectSetBatch) -> NDArray[np.int64]:
        """Labels of objects of which the view shows enough, without noise."""
        instances = self.renderer.render_surface(
            view.volumes.tsdf, batch.instances, self.grid, view.cameras
        ).instances
        labels, pixels = np.unique(instances.cpu().numpy(), return_counts=True)
        return np.asarray(labels[(labels > 0) & (pixels >= self.enough)])

    def _scores(
        self, decomposition: FoundSet, batch: ObjectSetBatch, visible_labels: NDArray[np.int64]
    ) -> dict[str, float]:
        instances = batch.instances[0].cpu().numpy()
        ids = np.unique(instances[instances > 0])
        true = instances[None] == ids[:, None, None, None]
        set_scores = decomposition_scores(decomposition.objects, true, self.matching)
        wrong = {name: float(getattr(set_scores, name) > 0) for name in _ERRORS}
        occupied, mine = instances > 0, decomposition.objects.any(axis=0)
        scores = {
            "object_iou": set_scores.object_iou,
            "ari": adjusted_rand_score(decomposition.labels[occupied], instances[occupied]),
            "missing_or_joined": max(wrong["missing"], wrong["joined"]),
            "duplicate_or_split": max(wrong["duplicate"], wrong["split"]),
            **wrong,
            "missing_seen": float(
                (~found_objects(decomposition.objects, true)[np.isin(ids, visible_labels)]).any()
            ),
            "count_error": float(abs(set_scores.excess)),
            "count_excess": float(set_scores.excess),
            "occupancy_iou": float((mine & occupied).sum() / max((mine | occupied).sum(), 1)),
        }
        if decomposition.prediction is not None:
            logits = decomposition.prediction.logits.to(batch.instances.device)
            matched = matched_objects(logits, batch.instances, batch.present)
            prediction = dataclasses.replace(
                decomposition.prediction, logits=logits, matched=matched
            )
            scores["cross_entropy"] = float(SetBinaryCrossEntropy()(prediction, batch))
        return scores


def _codes(decomposition: FoundSet) -> SceneCodes | None:
    """Codes of a network's prediction."""
    if decomposition.prediction is None or not decomposition.prediction.codes.shape[-1]:
        return None
    prediction = decomposition.prediction
    return SceneCodes(
        prediction.features[0].flatten(1).float().cpu().numpy(),
        prediction.cells[0].cpu().numpy(),
        decomposition.exists,
        prediction.codes[0].float().cpu().numpy(),
    )
