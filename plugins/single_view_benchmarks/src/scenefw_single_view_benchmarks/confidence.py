"""Whether predictions are as sure of objects as they are right about them."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.files import write_text
from scenefw.core.geometry import inverse, transform_points
from scenefw.core.types import TriangleMesh
from scenefw.core.versions import versions
from scenefw.evaluation.scored_scenes import scored_scenes
from scenefw_single_view_benchmarks.confidence_results import ConfidenceResult, ObjectConfidence
from scenefw_single_view_benchmarks.solid_overlap import best_solid_ious

if TYPE_CHECKING:
    from collections.abc import Mapping

    from scenefw.core.protocols import Track
    from scenefw.core.types import Int32, SceneEstimate
    from scenefw.evaluation.kept_rows import KeptRows
    from scenefw.perception.pipeline import ReconstructionPipeline
    from scenefw_annotated_views.annotations import AnnotatedScenes, AnnotatedView


class ConfidenceEvaluation:
    """Compares the confidence of predicted objects with their IoU with the truth.

    Every image is predicted twice, as `run=predict` does: by itself, and with its objects marked.

    Args:
        families: annotated scenes by name, to fit a calibration to; None leaves one out.
        method: predicts; its calibration is judged.
        validation: further families, which nothing is fitted to.
        output: folder for what was fitted, `calibration.json`; None: it isn't written.
        kept: finished images of an interrupted run; None keeps none.
        workers: images at once; None: as many as torch has threads.

    Raises:
        ConfigError: no family, or only one hypothesis.
    """

    def __init__(
        self,
        families: Mapping[str, AnnotatedScenes | None],
        method: ReconstructionPipeline,
        validation: Mapping[str, AnnotatedScenes | None] | None = None,
        output: str | Path | None = None,
        kept: KeptRows | None = None,
        workers: int | None = None,
    ) -> None:
        named = {**families, **(validation or {})}
        self.families = {name: scenes for name, scenes in named.items() if scenes is not None}
        self.validation = frozenset(validation or {})
        if not self.families:
            raise ConfigError("nothing to judge confidence on; leave one of evaluation.families")
        if method.samples < 2:
            raise ConfigError(
                f"reconstructor.samples is {method.samples}: agreement needs 2 samples or more"
            )
        self.method, self.kept, self.workers = method, kept, workers
        self.output = None if output is None else Path(output)
        self.images = [
            (name, scene, marked)
            for name, scenes in self.families.items()
            for scene in range(len(scenes))
            for marked in (False, True)
        ]

    def run(self, track: Track = lambda items, _: items) -> ConfidenceResult:
        """Scores all images; `track(items, what)` shows a bar of the loop."""
        image_objects = scored_scenes(
            self.score,
            len(self.images),
            lambda rows: [ObjectConfidence(**row) for row in rows],
            track,
            self.kept,
            self.workers,
            packed=lambda objects: [asdict(item) for item in objects],
        )
        objects = tuple(item for image in image_objects for item in image)
        result = ConfidenceResult(objects, self.method.samples, self.validation)
        if self.output is not None and result.fitted is not None:
            about = {
                "about": "Cues about objects to their expected IoU, by experiment=confidence",
                "families": sorted(set(self.families) - self.validation),
                "objects": int((~result.is_validation).sum()),
                "commit": versions().get("commit"),
            }
            text = json.dumps({**about, **result.fitted.content}, indent=1)
            write_text(self.output / "calibration.json", text + "\n")
        return result

    def score(self, number: int) -> list[ObjectConfidence]:
        """All objects that are predicted of an image, but those of which nothing is known."""
        family, scene, marked = self.images[number]
        (view,) = self.families[family].views(scene, 1)
        estimate = self._estimate(view, _marks(view) if marked else None)
        if estimate is None:
            return []
        return [
            ObjectConfidence(family, scene, marked, float(iou), item.confidence, item.cues)
            for item, iou in zip(estimate.objects, true_ious(estimate, view), strict=True)
            if not _is_unknown(estimate, item.id, view)
        ]

    def _estimate(self, view: AnnotatedView, mask: Int32 | None) -> SceneEstimate | None:
        """None if the image is of no use, as one in which hardly any table can be seen."""
        try:
            observation = self.method.observe(view.frame, mask)
            return self.method.reconstruct(observation, first_only=True)[0]
        except InputError:
            return None


def true_ious(estimate: SceneEstimate, view: AnnotatedView) -> list[float]:
    """IoU of each predicted object with the true one that it is most like."""
    motion = view.frame.camera.T_world_camera @ inverse(estimate.frame.camera.T_world_camera)
    predicted = [
        TriangleMesh(transform_points(motion, item.mesh.vertices), item.mesh.faces)
        for item in estimate.objects
    ]
    true = [
        TriangleMesh(transform_points(item.pose.matrix, item.mesh.vertices), item.mesh.faces)
        for item in view.objects
    ]
    return best_solid_ious(predicted, true).tolist()


def _marks(view: AnnotatedView) -> Int32:
    """Numbers (H, W) of the objects that pixels show, 0 = none."""
    marks = np.zeros(view.frame.depth.shape, np.int32)
    for label, silhouette in enumerate(view.silhouettes, start=1):
        marks[silhouette.visible] = label
    return marks


def _is_unknown(estimate: SceneEstimate, label: int, view: AnnotatedView) -> bool:
    """Whether most pixels of an object show things of which nothing is known."""
    if view.unknown is None or estimate.masks is None:
        return False
    pixels = view.unknown[estimate.masks == label]
    return bool(len(pixels) and pixels.mean() > 0.5)
