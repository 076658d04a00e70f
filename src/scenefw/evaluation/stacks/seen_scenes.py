"""Scenes seen by random cameras, on all grids that an evaluation needs."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from scenefw.core import rng
from scenefw.core.errors import InputError
from scenefw.core.protocols import Reconstructor
from scenefw.core.types import Camera, Float64, GridSpec
from scenefw.data.batches.stacks import SceneSet
from scenefw.data.batches.views import ViewBatch, ViewMaker
from scenefw.evaluation.stacks.draws import VISIBLE_POINTS, Truth
from scenefw.evaluation.stacks.surface_scores import Surfaces
from scenefw.evaluation.stacks.visibility import VisibleSurface
from scenefw.kernels.cameras import camera_of
from scenefw.metrics.sampling import sample_surface

Sample = tuple[Tensor, Tensor]


@dataclass(frozen=True)
class Streams:
    """Random streams of one kind of views: cameras and noise, points on surfaces, codes."""

    views: int
    points: int
    codes: int


@dataclass(frozen=True)
class SeenScene:
    """One scene seen by one camera.

    Args:
        index: of the scene in its data set.
        view: number of the view.
        batches: batches of one by grid, all of the same camera.
        finest: the grid of the true surface.
        camera: that saw it.
        surfaces: the true ones.
        points: generator of points on the true surfaces.
        points_of: makes the generator of points on what a method draws, by its name and the
            number of the draw: figures of one don't depend on what others are scored beside it.
        codes: makes the generator of codes, the same one each time.
    """

    index: int
    view: int
    batches: Mapping[GridSpec, ViewBatch]
    finest: GridSpec
    camera: Camera
    surfaces: Surfaces | None
    points: np.random.Generator
    points_of: Callable[[str, int], np.random.Generator]
    codes: Callable[[], torch.Generator]

    def samples(self, method: Reconstructor, grid: GridSpec, count: int) -> list[Sample]:
        """At most `count` different samples, TSDF and instances (X, Y, Z) of each."""
        partial = self.batches[grid].partial
        completions = method.complete(partial, grid, count, self.codes())
        return distinct([(scenes.tsdf[0], scenes.instances[0]) for scenes in completions])

    def truth(self, grid: GridSpec, points: Float64) -> Truth:
        """The truth on a grid; `points` are on its visible surface."""
        batch = self.batches[grid]
        above = torch.from_numpy(grid.centres()[..., 2] > 0)
        return Truth(
            batch.volumes.tsdf[0, 0].cpu().numpy(),
            batch.volumes.instances[0].cpu().numpy(),
            (~batch.partial.observed[0, 0].cpu() & above).numpy(),
            points[:VISIBLE_POINTS],
            grid,
        )

    def visible_points(self) -> Float64:
        """Points on the visible surface of the truth (m).

        Raises:
            InputError: nothing of the scene is visible.
        """
        if self.surfaces is None or self.surfaces.visible is None:
            raise InputError(
                "the camera sees nothing of a scene; choose viewpoints that look at the stack"
            )
        return sample_surface(self.surfaces.visible, VISIBLE_POINTS, self.points).points


@dataclass(eq=False)
class SceneViews:
    """Makes views of scenes.

    Args:
        makers: by grid.
        visible: finds visible surfaces.
        seed: of everything random.
        device: where volumes and views are computed.
    """

    makers: Mapping[GridSpec, ViewMaker]
    visible: VisibleSurface
    seed: int = 0
    device: str = "cpu"

    def see(self, scenes: SceneSet, row: int, view: int, streams: Streams) -> SeenScene:
        """One view of one scene of a split."""
        parameters = scenes.parameters([row], self.device)
        batches = {
            grid: maker.make_one(parameters, rng.generator(self.seed, streams.views, row, view))
            for grid, maker in self.makers.items()
        }
        finest = max(self.makers, key=lambda grid: grid.resolution)
        camera = camera_of(batches[finest].cameras, 0)
        true = batches[finest].volumes.tsdf[0, 0]
        of_points = streams.points, row, view
        code_seed = rng.torch_seed(self.seed, streams.codes, row, view)
        return SeenScene(
            int(scenes.indices[row]),
            view,
            batches,
            finest,
            camera,
            Surfaces.of(true, finest, camera, self.visible),
            rng.generator(self.seed, *of_points),
            lambda name, draw: rng.generator(self.seed, *of_points, rng.number_of(name), draw),
            lambda: torch.Generator().manual_seed(code_seed),
        )


def distinct(samples: Sequence[Sample]) -> list[Sample]:
    """One of all if a method without randomness repeats the same result, else all."""
    first = samples[0][0]
    is_repeated = all(
        s.data_ptr() == first.data_ptr() and s.shape == first.shape for s, _ in samples
    )
    return [samples[0]] if is_repeated else list(samples)
