"""Pictures of drawn codes for one view and for more, and of ways from one code to another."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import torch

from scenefw.core.errors import ConfigError
from scenefw.kernels.cameras import camera_of
from scenefw.matching.instances import renumbered_like
from scenefw.report.blocks import Picture
from scenefw.report.palette import instance_colours
from scenefw.report.pictures import beside, save_picture
from scenefw.report.shading import Solid, draw, turned

if TYPE_CHECKING:
    from scenefw.core.batches import Completion
    from scenefw.core.types import Float32, Int32
    from scenefw_several_views.latent_space import LatentSpaceEvaluation
    from scenefw_several_views.scene_in_views import SceneInViews

_TILE = (240, 180)
_BEHIND = 180.0  # degrees
_DRAWS = 3


class LatentSpaceGallery:
    """Two pictures per scene: draws by the number of views, from behind; and a way between codes.

    Args:
        evaluation: whose scenes are shown.
        output: the run's folder; files go to `gallery` in it.
        count: of scenes, the first ones.

    Raises:
        ConfigError: no scene is to be shown.
    """

    def __init__(
        self, evaluation: LatentSpaceEvaluation, output: str | Path, count: int = 2
    ) -> None:
        if count < 1:
            raise ConfigError(f"the gallery shows {count} scenes; expected at least 1")
        self.evaluation, self.output, self.count = evaluation, Path(output), count

    def show(self) -> tuple[Picture, ...]:
        """Two pictures per scene.

        Raises:
            StorageError: the folder can't be written.
        """
        rows = range(min(self.count, len(self.evaluation.scenes)))
        pictures = []
        for row in rows:
            observation = self.evaluation.see(row)
            pictures += [self._draws(observation), self._way(observation)]
        return tuple(pictures)

    @torch.no_grad()
    def _draws(self, observation: SceneInViews) -> Picture:
        counts = self.evaluation.counts
        tiles, titles = [], []
        for count in sorted({counts[0], counts[len(counts) // 2], counts[-1]}):
            scenes = self.evaluation.completions(observation, count)[: _DRAWS + 1]
            tiles += [self._tile(scene, observation, _BEHIND) for scene in scenes]
            views = f"{count} view" + "s" * (count > 1)
            draws = [f"draw {number}" for number in range(1, len(scenes))]
            titles += [f"{views}, zero code", *draws]
        width = _DRAWS + 1
        tiles.append(self._truth(observation, _BEHIND))
        titles.append("truth")
        path = f"gallery/draws_{observation.index}.jpg"
        save_picture(beside(tiles, titles, width), self.output / path)
        return Picture(path, f"scene {observation.index}, draws of codes, from behind")

    @torch.no_grad()
    def _way(self, observation: SceneInViews) -> Picture:
        scenes = self.evaluation.between(observation)
        sides = [self._tile(scene, observation, _BEHIND) for scene in scenes]
        share = [f"{100 * i / (len(scenes) - 1):.0f} %" for i in range(len(scenes))]
        path = f"gallery/way_{observation.index}.jpg"
        save_picture(beside(sides, share, -(-len(sides) // 2)), self.output / path)
        return Picture(
            path, f"scene {observation.index}, from one drawn code to another, from behind"
        )

    def _tile(self, scene: Completion, observation: SceneInViews, angle: float) -> Float32:
        truth = observation.batches[0].volumes.instances[0].cpu().numpy()
        labels = renumbered_like(scene.instances[0].cpu().numpy(), truth)
        return self._render(scene.tsdf[0].cpu().numpy(), labels, observation, angle)

    def _truth(self, observation: SceneInViews, angle: float) -> Float32:
        volumes = observation.batches[0].volumes
        labels = volumes.instances[0].cpu().numpy()
        return self._render(volumes.tsdf[0, 0].cpu().numpy(), labels, observation, angle)

    def _render(
        self, tsdf: Float32, labels: Int32, observation: SceneInViews, angle: float
    ) -> Float32:
        grid = self.evaluation.grid
        solid = Solid(tsdf, labels, grid, instance_colours(int(labels.max(initial=0))))
        camera = camera_of(observation.batches[0].cameras, 0).resized(*_TILE)
        true = observation.batches[0].volumes.tsdf[0, 0].cpu().numpy() < 0
        return draw(solid, turned(camera, grid.centres()[true], angle))
