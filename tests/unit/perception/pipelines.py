"""Pipelines whose objects are known beforehand, for tests of what comes before and after them."""

import numpy as np
import torch
from tests.unit.perception.obstacles import OBSTACLES
from tests.unit.perception.synthetic import STACK

from scenefw.mapping.projective import Projective
from scenefw.perception.estimate.assembly import SceneAssembly
from scenefw.perception.observation.doctor import Doctor
from scenefw.perception.observation.floor import FloorFinder
from scenefw.perception.observation.observer import Observer
from scenefw.perception.observation.workspace import WorkspaceFinder
from scenefw.perception.pipeline import ReconstructionPipeline
from scenefw.perception.steps import Objects, ObjectSet


def pipeline_of(completion=None, *, carve=True, calibration=None, **steps):
    """A pipeline with an observer that learns nothing; `steps` are its further arguments."""
    observer = Observer(Projective(), FloorFinder(), WorkspaceFinder(OBSTACLES), Doctor())
    assembly = SceneAssembly(calibration, carve=carve)
    return ReconstructionPipeline(assembly, observer, completion=completion, **steps)


class KnownBoxes:
    """Answers with the true boxes, in a world that the camera sees along +y.

    A completion, or a grouping whose rough volumes are the boxes. `requests` are the views that it
    was asked about, and a random number of each.
    """

    def __init__(self, grid, boxes=STACK):
        self.grid, self.boxes = grid, boxes
        self.metadata = {"made": "by hand"}
        self.requests = []

    def complete(self, fits, view, samples, generator):
        self.requests.append((view, torch.rand(1, generator=generator).item()))
        tsdf, instances = self.volumes(view.grid)
        volumes = {"mine": torch.from_numpy(tsdf)[None, None]}
        return [ObjectSet(Objects(None, tsdf, instances, volumes))] * samples

    def group(self, segments, view):
        return Objects(segments, *self.volumes(view.grid))

    def volumes(self, grid):
        """TSDF and instances (X, Y, Z)."""
        distances = self.distances(grid)
        tsdf = distances.min(axis=0).clip(-grid.truncation, grid.truncation)
        instances = np.where(tsdf < 0, distances.argmin(axis=0) + 1, 0)
        return tsdf.astype(np.float32), instances.astype(np.int32)

    def distances(self, grid):
        """Signed distances of the boxes (N, X, Y, Z), exact (Quilez)."""
        fields = []
        for box in self.boxes:
            lower, upper = np.array(box.lower), np.array(box.upper)
            q = np.abs(grid.centres() - (lower + upper) / 2) - (upper - lower) / 2
            fields.append(np.linalg.norm(q.clip(min=0), axis=-1) + q.max(axis=-1).clip(max=0))
        return np.stack(fields)
