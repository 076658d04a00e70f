"""Masks, shapes, hypotheses, confidences and stability of things whose meshes are known."""

from __future__ import annotations

import threading
from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.settings import NOT_NEGATIVE, POSITIVE, at_least
from scenefw.evaluation.scored_scenes import scored_scenes
from scenefw.metrics.object_sets import energy_score
from scenefw.perception.estimate import contacts
from scenefw_simulators.body_maker import BodyMaker
from scenefw_simulators.motions import motions
from scenefw_single_view_benchmarks.confidence_results import ObjectConfidence
from scenefw_single_view_benchmarks.mask_scores import mask_scores
from scenefw_single_view_benchmarks.object_shapes import SolidShape, shape_scores
from scenefw_single_view_benchmarks.seams import seam_scores
from scenefw_single_view_benchmarks.shape_methods import (
    PredictedScene,
    VisibleHulls,
    pipeline_scenes,
)
from scenefw_single_view_benchmarks.stability_results import Pile
from scenefw_single_view_benchmarks.things_results import (
    METHOD_MASKS,
    RISING,
    TRUE_MASKS,
    TRUTH,
    Draws,
    Standing,
    ThingImage,
    ThingsResult,
)
from scenefw_single_view_benchmarks.true_things import TrueThings

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from scenefw.core.protocols import Engine, Track
    from scenefw.core.types import Float64, Frame, Int32, ObjectEstimate, SceneObject
    from scenefw.evaluation.kept_rows import KeptRows
    from scenefw.perception.observation.observation import Observation
    from scenefw.perception.pipeline import ReconstructionPipeline
    from scenefw_annotated_views.annotations import AnnotatedScenes, AnnotatedView
    from scenefw_single_view_benchmarks.generated_stacks import GeneratedStacks

_AMONG = 400  # points of a surface where hypotheses are compared with each other
_UNKNOWN = 0.5  # of an object's pixels: nothing is known of the thing that they show


class ThingsEvaluation:
    """Scores all that is said about things in images, beside references that learn nothing.

    An object counts if enough of its pixels are seen. Predicted objects are matched to true ones
    by the pixels that they share; without a match an object has F and IoU 0, and no distance. An
    image that a method refuses has no objects in its rows.

    Args:
        strata: annotated scenes by stratum and sensor; None leaves one out.
        methods: pipelines by name, the main one first; None leaves one out. The first observes for
            the references.
        references: by name, the strongest first; None leaves one out.
        scenes: what the scenes are made of, by name, to show how they are made; they are made once.
        engine: simulates scenes.
        bodies: makes rigid bodies.
        draws: hypotheses of an image that are judged as such.
        draw_scenes: first scenes of each stratum whose hypotheses and whose stability are judged;
            None: all.
        steps: of a simulation at most; it ends when everything rests.
        furthest: centres of stable scenes move less (m).
        steepest: objects of stable scenes turn less (degrees).
        voxel: side of the voxels of IoUs (m).
        tolerance: see `mask_scores.mask_scores`.
        min_pixels: objects of fewer visible pixels (of an image 640 wide) count for nothing.
        about: the images, for readers, in sentences.
        workers: images at once; None: as many as torch has threads.
        kept: finished images of an interrupted run; None keeps none.

    Raises:
        ConfigError: no scenes or no method.
    """

    def __init__(
        self,
        strata: Mapping[str, Mapping[str, AnnotatedScenes | None]],
        methods: Mapping[str, ReconstructionPipeline | None],
        references: Mapping[str, VisibleHulls | None],
        engine: Engine,
        bodies: BodyMaker,
        scenes: Mapping[str, GeneratedStacks] | None = None,
        draws: int = 10,
        draw_scenes: int | None = None,
        steps: int = 2400,
        furthest: float = 0.2,
        steepest: float = 30.0,
        voxel: float = 0.006,
        tolerance: float = 0.003,
        min_pixels: float = 100.0,
        about: str = "",
        workers: int | None = None,
        kept: KeptRows | None = None,
    ) -> None:
        at_least(2).require(draws=draws)
        NOT_NEGATIVE.require(draw_scenes=draw_scenes or 0, steps=steps, min_pixels=min_pixels)
        POSITIVE.require(furthest=furthest, steepest=steepest, voxel=voxel)
        self.methods = {name: method for name, method in methods.items() if method is not None}
        self.references = {name: item for name, item in references.items() if item is not None}
        self.groups = {
            (stratum, sensor): images
            for stratum, sensors in strata.items()
            for sensor, images in sensors.items()
            if images is not None
        }
        if not self.methods or not self.groups:
            raise ConfigError("nothing to evaluate; leave one of evaluation.methods and .strata in")
        self.scenes, self.engine, self.bodies = dict(scenes or {}), engine, bodies
        self.draws, self.draw_scenes, self.steps = draws, draw_scenes, steps
        self.furthest, self.steepest = furthest, steepest
        self.voxel, self.tolerance, self.min_pixels = voxel, tolerance, min_pixels
        self.about, self.workers, self.kept = about, workers, kept
        self._physics = threading.Lock()  # an engine holds one world

    def run(self, track: Track = lambda items, _: items) -> ThingsResult:
        """Scores all images; `track(items, what)` shows a bar of each loop."""
        for name, stacks in self.scenes.items():
            for row in track(range(len(stacks)), f"stacks, {name}"):
                stacks.objects(row)
        numbers = [(*key, scene) for key, part in self.groups.items() for scene in range(len(part))]
        images = scored_scenes(
            lambda number: self.score(*numbers[number]),
            len(numbers),
            ThingImage.restored,
            track,
            self.kept,
            self.workers,
        )
        names = (*self.methods, *self.references)
        return ThingsResult(
            tuple(images), names, tuple(self.references), self.voxel, self.draws, self.about
        )

    def score(self, stratum: str, sensor: str, scene: int) -> ThingImage:
        """All scores of one image."""
        (view,) = self.groups[stratum, sensor].views(scene, 1)
        truth = TrueThings.of(view, self.min_pixels, self.voxel)
        detections, refusals = self._estimates(view.frame, None, 1)
        is_judged = self.draw_scenes is None or scene < self.draw_scenes
        completions, _ = self._estimates(view.frame, truth.marks, self.draws if is_judged else 1)
        firsts = {name: scenes[0] for name, scenes in detections.items()}
        masks = {name: self._masks(firsts.get(name), truth) for name in self._names}
        masks[RISING] = self._mask_scores(truth.rising(next(iter(firsts.values()), None)), truth)
        shapes = {
            METHOD_MASKS: {n: self._shapes(firsts.get(n), truth) for n in self._names},
            TRUE_MASKS: {
                n: self._shapes(next(iter(completions.get(n, ())), None), truth, is_marked=True)
                for n in self._names
            },
        }
        draws = {n: d for n, s in completions.items() if is_judged and (d := self._draws(s, truth))}
        confidences = self._confidences(
            f"{stratum}/{sensor}", scene, view, firsts, completions, truth
        )
        return ThingImage(
            stratum,
            sensor,
            scene,
            truth.kinds,
            refusals,
            masks,
            shapes,
            draws,
            self._standing(stratum, scene, firsts) if is_judged else {},
            tuple(confidences),
            view.frame.notes,
        )

    @property
    def _names(self) -> tuple[str, ...]:
        return (*self.methods, *self.references)

    def _estimates(
        self, frame: Frame, marks: Int32 | None, count: int
    ) -> tuple[dict[str, list[PredictedScene]], dict[str, str]]:
        """Hypotheses of each method, and why others have none."""
        estimates: dict[str, list[PredictedScene]] = {}
        refusals: dict[str, str] = {}
        observed: Observation | str = ""
        for name, pipeline in self.methods.items():
            try:
                view = pipeline.observe(frame, marks)
                observed = observed or view
                estimates[name] = pipeline_scenes(pipeline, view, count)
            except InputError as error:
                observed = observed or str(error)
                refusals[name] = str(error)
        for name, reference in self.references.items():
            if isinstance(observed, str):
                refusals[name] = observed
            else:
                estimates[name] = [reference.scene(observed)]
        return estimates, refusals

    def _masks(self, scene: PredictedScene | None, truth: TrueThings) -> dict[str, float]:
        masks = np.zeros_like(truth.labels) if scene is None else scene.masks
        scores = self._mask_scores(masks, truth)
        if scene is None:
            scores |= dict.fromkeys(("overlap_f", "boundary_f", "objects_f75"), 0.0)
        return scores

    def _mask_scores(self, masks: Int32, truth: TrueThings) -> dict[str, float]:
        scores = mask_scores(masks, truth.labels, self.tolerance)
        seams = seam_scores(masks, truth.labels, self.tolerance)
        return asdict(scores) | {"count_error": scores.count_error} | asdict(seams)

    def _shapes(
        self, scene: PredictedScene | None, truth: TrueThings, *, is_marked: bool = False
    ) -> list[dict[str, float] | None]:
        """Scores of each true object; None: nothing was predicted of it."""
        if scene is None:
            return [None] * len(truth.kinds)
        meshes = truth.in_true_frame(scene)
        pairs = {number: number for number in truth.shapes} if is_marked else truth.matches(scene)
        scores: list[dict[str, float] | None] = []
        for number, shape in truth.shapes.items():
            mesh = meshes.get(pairs.get(number, 0))
            if mesh is None:
                scores.append(None)
                continue
            predicted = SolidShape(mesh, self.voxel)
            scores.append(shape_scores(predicted, shape, truth.visible[number])._asdict())
        return scores

    def _draws(self, scenes: Sequence[PredictedScene], truth: TrueThings) -> Draws | None:
        """Scores of hypotheses, on the marked objects that all of them have."""
        drawn = [
            {
                label: SolidShape(mesh, self.voxel)
                for label, mesh in truth.in_true_frame(scene).items()
            }
            for scene in scenes
        ]
        shared_numbers = [n for n in truth.shapes if all(n in shapes for shapes in drawn)]
        if not shared_numbers:
            return None
        to_truth = np.array(
            [[shapes[n].distance(truth.shapes[n]) for n in shared_numbers] for shapes in drawn]
        )
        among = np.array([_among([shapes[n] for shapes in drawn]) for n in shared_numbers])
        energies = [energy_score(to_truth[:, i], among[i]) for i in range(len(shared_numbers))]
        of_scenes = to_truth.mean(axis=1)
        return Draws(float(of_scenes[0]), float(np.mean(energies)), float(of_scenes.min()))

    def _standing(
        self, stratum: str, scene: int, firsts: Mapping[str, PredictedScene]
    ) -> dict[str, Standing]:
        """Of each method's scene, and of the true one where it is known as rigid bodies."""
        rows = {name: self._stands(item.objects) for name, item in firsts.items()}
        if stratum in self.scenes:
            rows[TRUTH] = Standing(*self._simulated(self.scenes[stratum].objects(scene)), 0.0, 0.0)
        return rows

    def _stands(self, objects: Sequence[ObjectEstimate]) -> Standing:
        placed = {item.id: item.placed for item in objects if item.placed is not None}
        bodies = self.bodies.make({item.id: item.mesh for item in objects}, placed)
        stable, displacement = self._simulated(tuple(bodies.bodies.values()))
        inside = {
            label for pair in contacts.overlaps(objects) for label in (pair.first, pair.second)
        } - {0}
        count = max(len(objects), 1)
        return Standing(
            stable, displacement, len(inside) / count, len(contacts.hovers(objects)) / count
        )

    def _simulated(self, solids: Sequence[SceneObject]) -> tuple[float, float]:
        """Whether they stay where they are, and how far they move (m)."""
        with self._physics:
            ends = motions(solids, self.engine, self.steps, until_rest=True)
        shifts = tuple(min(end.shift, self.furthest) for end in ends)
        turns = tuple(end.turn for end in ends)
        scores = Pile(shifts, turns).scores(self.furthest, self.steepest)
        return scores["stable"], scores["displacement"]

    def _confidences(
        self,
        family: str,
        scene: int,
        view: AnnotatedView,
        detections: Mapping[str, PredictedScene],
        completions: Mapping[str, Sequence[PredictedScene]],
        truth: TrueThings,
    ) -> list[ObjectConfidence]:
        """Of the first method's objects; the IoU is that with the true object most alike."""
        main = next(iter(self.methods))
        firsts = [(False, detections[main])] if main in detections else []
        firsts += [(True, completions[main][0])] if main in completions else []
        rows = []
        for is_marked, estimate in firsts:
            meshes = truth.in_true_frame(estimate)
            for item in estimate.objects:
                pixels = estimate.masks == item.id
                if view.unknown is not None and view.unknown[pixels].mean() > _UNKNOWN:
                    continue  # of a thing of which nothing is known
                predicted = SolidShape(meshes[item.id], self.voxel)
                iou = max((predicted.iou(true) for true in truth.all_shapes.values()), default=0.0)
                rows.append(
                    ObjectConfidence(
                        family, scene, is_marked, iou, item.confidence, dict(item.cues)
                    )
                )
        return rows


def _among(shapes: Sequence[SolidShape]) -> Float64:
    """Distances (S, S) among shapes (m)."""
    distances = np.zeros((len(shapes), len(shapes)))
    for i, first in enumerate(shapes):
        for j in range(i):
            distances[i, j] = distances[j, i] = first.distance(shapes[j], _AMONG)
    return distances
