"""Whether grasps that disturb nothing in the prediction disturb nothing in truth (thesis 5.5)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import torch
from scipy.spatial import cKDTree

from scenefw.core import rng
from scenefw.core.batches import Completion
from scenefw.core.errors import ConfigError
from scenefw.core.protocols import (
    MappingMethod,
    Noise,
    Reconstructor,
    Renderer,
    Track,
    Workers,
)
from scenefw.core.types import Camera, GridSpec, Int32, PlacedShape, SceneObject
from scenefw.data.batches.stacks import SceneSet
from scenefw.data.batches.views import ViewMaker, Viewpoints
from scenefw.kernels.cameras import camera_of
from scenefw.matching.instances import renumbered_like
from scenefw.postprocessing.surfaces import instance_meshes
from scenefw_grasping.choices import Tried
from scenefw_grasping.grasps import Film, Lift, RankedGrasp, Ranking
from scenefw_grasping.protocols import Grasping
from scenefw_grasping.results import GraspExample, GraspingResult, SceneGrasps
from scenefw_simulators.body_maker import Bodies, BodyMaker

_STREAM = 1  # the views on which reconstruction is scored
_OTHER = "another object came up"
_NEAR = 0.01  # m: objects that are nearer are neighbours

Objects = Mapping[int, SceneObject]


@dataclass(frozen=True, eq=False)
class Job:
    """A scene to grasp in.

    Args:
        scene: number of the scene in its data set.
        camera: that saw it.
        predicted: objects by label.
        true: objects by label.
        stands_for: true label of each predicted one, 0 = none.
        left_out: why predicted objects have no body.
        film: whether to film the chosen grasp.
    """

    scene: int
    camera: Camera
    predicted: Objects
    true: Objects
    stands_for: Mapping[int, int]
    left_out: tuple[str, ...]
    film: bool


class GraspingEvaluation:
    """Ranks grasps in predicted scenes and simulates all of them in the true ones.

    Every grasp is simulated in both, so that every way to choose is scored on the same grasps. A
    lift fails if the object that the predicted one stands for doesn't come up.

    Args:
        scenes: of the split.
        method: predicts them.
        viewpoints: draws cameras.
        renderer: makes depth images of the true TSDF.
        mapping: from depth to partial TSDF.
        grasping: proposes and simulates.
        noise: disturbs the depth images.
        bodies: makes rigid bodies of predicted objects.
        grid: for a method that has none.
        still: objects that move by less are undisturbed (m).
        examples: scenes whose chosen grasp is filmed.
        parallel: processes that simulate; None: this one alone.
        seed: of cameras, noise and codes.
        device: where volumes and views are computed.

    Raises:
        ConfigError: no grid.
    """

    def __init__(
        self,
        scenes: SceneSet,
        method: Reconstructor,
        viewpoints: Viewpoints,
        renderer: Renderer,
        mapping: MappingMethod,
        grasping: Grasping,
        noise: Mapping[str, Noise] | None = None,
        bodies: BodyMaker | None = None,
        grid: GridSpec | None = None,
        still: float = 0.01,
        examples: int = 3,
        parallel: Workers | None = None,
        seed: int = 0,
        device: str = "cpu",
    ) -> None:
        common = method.grid or grid
        if common is None:
            raise ConfigError("the method has no grid; give evaluation.grid=${grid}")
        self.views = ViewMaker(common, viewpoints, renderer, mapping, noise)
        self.scenes, self.method, self.grasping = scenes, method, grasping
        self.bodies = bodies or BodyMaker()
        self.still, self.examples, self.parallel = still, examples, parallel
        self.seed, self.device = seed, device

    @torch.no_grad()
    def run(self, track: Track = lambda items, _: items) -> GraspingResult:
        """Predicts all scenes, then simulates; `track(items, what)` shows bars of both loops."""
        rows = list(range(len(self.scenes)))
        filmed = {int(i) for i in np.linspace(0, len(rows) - 1, min(self.examples, len(rows)))}
        jobs = [self._job(row, film=row in filmed) for row in track(rows, "predictions")]
        results = self._simulated(jobs)
        outcomes = [next(results) for _ in track(jobs, "grasps of scenes")]
        films = tuple(example for _, example in outcomes if example is not None)
        return GraspingResult(tuple(grasps for grasps, _ in outcomes), self.still, films)

    def _simulated(self, jobs: list[Job]) -> Iterator[tuple[SceneGrasps, GraspExample | None]]:
        work = partial(grasp_scene, self.grasping)
        return map(work, jobs) if self.parallel is None else self.parallel.each(work, jobs)

    def _job(self, row: int, *, film: bool) -> Job:
        parameters = self.scenes.parameters([row], self.device)
        view = self.views.make_one(parameters, rng.generator(self.seed, _STREAM, row))
        codes = torch.Generator().manual_seed(rng.torch_seed(self.seed, _STREAM, row))
        scene = self.method.complete(view.partial, self.views.grid, 1, codes)[0]
        bodies = self._bodies(scene)
        true = view.volumes.instances[0].cpu().numpy()
        return Job(
            int(self.scenes.indices[row]),
            camera_of(view.cameras, 0),
            bodies.bodies,
            dict(enumerate(self.scenes.objects(row), 1)),
            stands_for(scene.instances[0].cpu().numpy(), true),
            tuple(bodies.left_out.values()),
            film,
        )

    def _bodies(self, scene: Completion) -> Bodies:
        meshes = instance_meshes(scene.tsdf[0], scene.instances[0], self.views.grid)
        return self.bodies.make(meshes, scene.placed[0] if scene.placed else {})


def stands_for(predicted: Int32, true: Int32) -> dict[int, int]:
    """True label of each predicted one, by the overlap of volumes; 0 = none."""
    renumbered = renumbered_like(predicted, true)
    true_labels = set(np.unique(true).tolist())
    matches = {}
    for label in np.unique(predicted[predicted > 0]).tolist():
        true_label = int(renumbered[predicted == label][0])
        matches[label] = true_label if true_label in true_labels else 0
    return matches


def grasp_scene(grasping: Grasping, job: Job) -> tuple[SceneGrasps, GraspExample | None]:
    """Ranks the grasps of a predicted scene and simulates them in the true one, and one film."""
    eye = job.camera.T_world_camera[:3, 3]
    ranking = grasping.rank(job.predicted, eye)
    lifts = [grasping.lift(job.true, candidate.grasp) for candidate in ranking.grasps]
    tops, neighbours = _tops(ranking.resting), _neighbours(ranking.resting)
    tries = tuple(
        _grasp_outcome(
            number, candidate, lift, job.stands_for.get(candidate.grasp.label, 0), tops, neighbours
        )
        for number, (candidate, lift) in enumerate(zip(ranking.grasps, lifts, strict=True))
    )
    left_out = (*job.left_out, *ranking.left_out.values())
    filmed = job.film and bool(tries)
    example = _example(grasping, job, ranking, tries[0]) if filmed else None
    return SceneGrasps(job.scene, tries, left_out), example


def _grasp_outcome(
    rank: int,
    candidate: RankedGrasp,
    lift: Lift,
    target: int,
    tops: Mapping[int, float],
    neighbours: Mapping[int, int],
) -> Tried:
    grasp = candidate.grasp
    return Tried(
        grasp.label,
        rank,
        tops[grasp.label],
        neighbours[grasp.label],
        grasp.seal,
        grasp.outward,
        grasp.seen,
        candidate.lift.disturbance,
        lift.disturbance,
        max(lift.shifts.values(), default=0.0),
        lift.failure or ("" if lift.label == target else _OTHER),
    )


def _tops(objects: Objects) -> dict[int, float]:
    return {
        label: float(PlacedShape(item.shape, item.pose).mesh().vertices[:, 2].max())
        for label, item in objects.items()
    }


def _neighbours(objects: Objects) -> dict[int, int]:
    """How many objects are near each."""
    trees = {
        label: cKDTree(PlacedShape(item.shape, item.pose).mesh().vertices)
        for label, item in objects.items()
    }
    return {
        label: sum(
            bool(np.isfinite(tree.query(neighbour.data, distance_upper_bound=_NEAR)[0]).any())
            for number, neighbour in trees.items()
            if number != label
        )
        for label, tree in trees.items()
    }


def _example(grasping: Grasping, job: Job, ranking: Ranking, grasp: Tried) -> GraspExample:
    best = ranking.grasps[0]
    predicted = grasping.lift(ranking.resting, best.rehearsed, film=True)
    true = grasping.lift(job.true, best.grasp, film=True)
    became = grasp.failure or f"object {grasp.label} was lifted"
    words = (
        f"{became}; the others move by {1000 * grasp.disturbance:.0f} mm, "
        f"predicted {1000 * grasp.predicted:.0f} mm"
    )
    names = {true_label: label for label, true_label in job.stands_for.items() if true_label}
    unused = max([*job.stands_for, 0]) + 1
    return GraspExample(
        f"scene {job.scene}",
        words,
        job.camera,
        _film(predicted),
        _renamed(_film(true), names, unused),
    )


def _film(lift: Lift) -> Film:
    return lift.film or Film((), (), np.zeros((1, 0, 4, 4)), 0.1)


def _renamed(film: Film, names: Mapping[int, int], unused: int) -> Film:
    """Objects called as in the prediction; those that it lacks get further labels."""
    labels = tuple(names.get(label, unused + label) if label else 0 for label in film.labels)
    return replace(film, labels=labels)
