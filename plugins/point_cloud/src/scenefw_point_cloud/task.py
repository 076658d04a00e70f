"""The verb of the plugin: views in, point clouds out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from scenefw.core.rng import generator
from scenefw.core.types import Frame, GridSpec
from scenefw_point_cloud.picture import draw
from scenefw_point_cloud.representation import PointClouds


class PointCloudTask:
    """Writes a PLY and a picture for each view.

    Args:
        clouds: makes the clouds.
        input: depth image(s) to read; None: views of simulated test scenes.
        output: folder of the results.
        scenes: opens the simulated scenes, called without an input only.
        viewpoints: where cameras stand around them.
        renderer: draws their depth and labels.
        grid: voxel grid of the renderer.
        views: number of simulated views.
        seed: of the viewpoints.
    """

    def __init__(
        self,
        clouds: PointClouds,
        input: str | None,  # noqa: A002 - the name of the setting
        output: str,
        scenes: Callable[[], Any],
        viewpoints: Any,
        renderer: Any,
        grid: GridSpec,
        views: int = 3,
        seed: int = 0,
    ) -> None:
        self.clouds = clouds
        self.input = input
        self.output = Path(output)
        self.scenes = scenes
        self.viewpoints = viewpoints
        self.renderer = renderer
        self.grid = grid
        self.views = views
        self.seed = seed

    def run(self) -> dict[str, float]:
        """Makes all clouds; returns how many points they hold."""
        counts = []
        for frame in self._frames():
            cloud = self.clouds.of_frame(frame)
            cloud.save(self.output / f"{frame.name}.ply")
            draw(cloud, frame.camera, self.output / f"{frame.name}.png", frame.name)
            counts.append(len(cloud))
        return {"clouds": float(len(counts)), "points": float(np.mean(counts))}

    def _frames(self) -> Iterator[Frame]:
        if self.input is None:
            yield from self._simulated()
            return
        from scenefw.data.files.readers import read_frames

        for index, frame in enumerate(read_frames(Path(self.input))):
            name = Path(frame.name).stem or f"view_{index:03d}"
            yield Frame(frame.depth, frame.camera, frame.colour, frame.labels, name)

    def _simulated(self) -> Iterator[Frame]:
        from scenefw.kernels.cameras import stack_cameras
        from scenefw.representations.volumes import scene_volumes

        scenes = self.scenes()
        for index in range(min(self.views, len(scenes))):
            camera = self.viewpoints.sample(generator(self.seed, index))
            volumes = scene_volumes(scenes.parameters([index], "cpu"), self.grid)
            surface = self.renderer.render_surface(
                volumes.tsdf, volumes.instances, self.grid, stack_cameras([camera], "cpu")
            )
            depth, labels = surface.depth[0].numpy(), surface.instances[0].numpy()
            yield Frame(depth, camera, labels=labels.astype(np.int32), name=f"view_{index:03d}")
