"""A data set without physics; apart, so that its processes need not import what tests do."""

import time

import numpy as np

from scenefw.core.rng import generator
from scenefw.core.types import Pose, Scene, SceneObject
from scenefw_simulators.generation.generate import Generate
from scenefw_simulators.generation.library import SuperquadricLibrary
from scenefw_sweeps.local import Local


class Scattering:
    """Objects at random poses, no physics; every fifth attempt fails, and each takes a while."""

    def __init__(self, pause=0.0, calls=None, split=None):
        self.split = split
        self.shapes = SuperquadricLibrary(size=7)
        self.pause = pause
        self._calls = calls

    def generate(self, index, seed):
        time.sleep(self.pause)
        if self._calls is not None:
            self._calls.append(index)
        if index % 5 == 4:
            return None
        rng = generator(seed, index)
        pose = Pose(rng.normal(size=3), np.array([1.0, 0, 0, 0]))
        objects = tuple(
            SceneObject(self.shapes.sample(rng), pose, 1.0) for _ in range(1 + index % 3)
        )
        return Scene(objects, index, seed)


def generated(folder, source, **settings):
    settings = {"attempts": 25, "shard_size": 4} | settings
    parallel = settings.pop("parallel", Local(1))
    task = Generate(
        source, parallel, shards=str(folder / "shards"), output=str(folder / "out"), **settings
    )
    return task.run(), folder / "out" / "superquadric_stacks_v2.npz"
