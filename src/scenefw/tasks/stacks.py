"""Shows the stacks that everything learns from, and makes some of them anew as a check."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from scenefw.core.errors import MissingDependencyError
from scenefw.core.geometry import look_at
from scenefw.core.protocols import SceneSource
from scenefw.core.types import Camera, GridSpec
from scenefw.data.stacks import StackScenes
from scenefw.report.blocks import Picture, Section, Text
from scenefw.report.gallery import beside, save_picture
from scenefw.report.palette import instance_colours
from scenefw.report.shading import Solid, draw, turned
from scenefw.representations.volumes import scene_volumes
from scenefw.scenes.storage import pack

_VIEW = Camera(320, 240, 380.0, 380.0, 159.5, 119.5, look_at((0.7, -0.9, 0.6), (0.0, 0.0, 0.1)))


class Stacks:
    """Pictures of scenes of a data set, and a few attempts simulated again.

    Args:
        scenes: the data set, all parts of it.
        source: made these scenes.
        output: the run's folder.
        shown: scenes to draw.
        simulated: scenes to make anew; 0 = none.
    """

    def __init__(
        self,
        scenes: StackScenes,
        source: SceneSource,
        output: str | Path,
        shown: int = 6,
        simulated: int = 3,
    ) -> None:
        self.scenes = scenes
        self.source = source
        self.output = Path(output)
        self.shown = shown
        self.simulated = simulated

    def show(self) -> tuple[Section, dict[str, float]]:
        """The section of the page, and figures: scenes, and how far those made anew lie apart.

        Raises:
            StorageError: the folder can't be written.
        """
        rows = np.linspace(0, len(self.scenes) - 1, min(self.shown, len(self.scenes)))
        tiles, titles = zip(
            *[self._tile(int(row)) for row in np.unique(rows.astype(int))], strict=True
        )
        save_picture(beside(tiles, titles), self.output / "gallery" / "stacks.jpg")
        picture = Picture("gallery/stacks.jpg", f"{len(tiles)} of {len(self.scenes)} scenes")
        figures = {"stacks/scenes": float(len(self.scenes))}
        words = "No scene was simulated in this run."
        if self.simulated:
            words, found = self._check()
            figures |= found
        return Section("Simulated stacks", (Text(words), picture)), figures

    def _tile(self, row: int) -> tuple[np.ndarray, str]:
        grid = GridSpec()
        volumes = scene_volumes(self.scenes.parameters([row]), grid)
        instances = volumes.instances[0].numpy()
        points = grid.centres()[instances > 0]
        solid = Solid(
            volumes.tsdf[0, 0].numpy(), instances, grid, instance_colours(instances.max())
        )
        return draw(solid, turned(_VIEW, points, 0.0)), f"scene {int(self.scenes.indices[row])}"

    def _check(self) -> tuple[str, dict[str, float]]:
        """Simulates the first scenes again; they must come out as they are stored."""
        seed = int(str(self.scenes.manifest().get("seed", 0)))
        try:
            made = [
                self.source.generate(int(i), seed) for i in self.scenes.indices[: self.simulated]
            ]
        except MissingDependencyError as error:
            return f"No scene was simulated: {error}", {}
        apart = self._apart([scene for scene in made if scene is not None])
        failed = sum(scene is None for scene in made)
        words = (
            f"{len(made)} scenes were simulated again in this run; their objects lie at most "
            f"{1000 * apart:.3g} mm from where the data set has them"
            + (f"; {failed} did not come out as scenes at all." if failed else ".")
        )
        return words, {"stacks/simulated": float(len(made)), "stacks/apart": apart}

    def _apart(self, made: Sequence) -> float:
        """Largest distance (m) between objects made anew and the stored ones."""
        if not made:
            return float("nan")
        new = pack(made)
        rows = [int(np.flatnonzero(self.scenes.indices == index)[0]) for index in new.index]
        old = self.scenes.parameters(rows)
        width = new.positions.shape[1]
        present = old.present.numpy()
        if present[:, width:].any():
            return float("inf")  # fewer objects than stored
        gaps = np.linalg.norm(old.positions.numpy()[:, :width] - new.positions, axis=-1)
        return float(gaps[present[:, :width]].max())
