"""Pictures of what methods make of one view and of several, from the front and from the back."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import torch

from scenefw.core.errors import ConfigError
from scenefw.evaluation.stacks.methods import described
from scenefw.kernels.cameras import camera_of
from scenefw.matching.instances import renumbered_like
from scenefw.report.blocks import Picture
from scenefw.report.palette import instance_colours
from scenefw.report.pictures import beside, save_picture
from scenefw.report.shading import Solid, draw, turned

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np

    from scenefw.core.types import Int32
    from scenefw_several_views.evaluation import SeveralViewsEvaluation
    from scenefw_several_views.scene_in_views import SceneInViews

_TILE = (320, 240)
_BEHIND = 180.0  # degrees


class SeveralViewsGallery:
    """A picture per scene: a row per method and one of the truth; the fewest and the most views.

    Args:
        evaluation: whose scenes and methods are shown.
        output: the run's folder; files go to `gallery` in it.
        methods: names of those shown, in their order.
        count: of scenes, the first ones.

    Raises:
        ConfigError: no scene is to be shown.
    """

    def __init__(
        self,
        evaluation: SeveralViewsEvaluation,
        output: str | Path,
        methods: Sequence[str],
        count: int = 2,
    ) -> None:
        if count < 1:
            raise ConfigError(f"the gallery shows {count} scenes; expected at least 1")
        self.evaluation, self.output, self.count = evaluation, Path(output), count
        self.methods = [name for name in methods if name in evaluation.methods]

    def show(self) -> tuple[Picture, ...]:
        """One picture per scene.

        Raises:
            StorageError: the folder can't be written.
        """
        rows = range(min(self.count, len(self.evaluation.scenes)))
        return tuple(self._picture(row) for row in rows)

    @torch.no_grad()
    def _picture(self, row: int) -> Picture:
        observation = self.evaluation.see(row)
        counts = sorted({self.evaluation.counts[0], self.evaluation.counts[-1]})
        volumes = observation.batches[0].volumes
        truth = volumes.instances[0].cpu().numpy()
        tiles, titles = [], []
        for name in self.methods:
            for count in counts:
                scene = self.evaluation.completions_by(name, observation, count)[0]
                labels = renumbered_like(scene.instances[0].cpu().numpy(), truth)
                sides = self._sides(scene.tsdf[0].cpu().numpy(), labels, observation)
                tiles += sides
                views = f"{count} view" + "s" * (count > 1)
                titles += [f"{name.replace('_', ' ')}, {views}", "from behind"]
        tiles += self._sides(volumes.tsdf[0, 0].cpu().numpy(), truth, observation)
        titles += ["truth", "from behind"]
        path = f"gallery/scene_{observation.index}.jpg"
        save_picture(beside(tiles, titles, 2 * len(counts)), self.output / path)
        words = "; ".join(
            f"{name.replace('_', ' ')}: {described(name).row}" for name in self.methods
        )
        return Picture(path, f"scene {observation.index}. {words}")

    def _sides(
        self, tsdf: np.ndarray, labels: Int32, observation: SceneInViews
    ) -> list[np.ndarray]:
        grid = self.evaluation.grid
        colours = instance_colours(int(labels.max(initial=0)))
        solid = Solid(tsdf, labels, grid, colours)
        camera = camera_of(observation.batches[0].cameras, 0).resized(*_TILE)
        truth = observation.batches[0].volumes.tsdf[0, 0].cpu().numpy() < 0
        points = grid.centres()[truth]
        return [draw(solid, turned(camera, points, angle)) for angle in (0.0, _BEHIND)]
