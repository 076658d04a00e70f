"""Shows the stacks that networks learn from, and simulates some of them again as a check."""

from pathlib import Path

import numpy as np

from scenefw.core.errors import MissingDependencyError
from scenefw.core.geometry import look_at
from scenefw.core.protocols import SceneSource
from scenefw.core.types import Camera, GridSpec, Scene
from scenefw.data.batches.stacks import StackScenes
from scenefw.report.blocks import Picture, Section, Text
from scenefw.report.palette import instance_colours
from scenefw.report.pictures import beside, save_picture
from scenefw.report.shading import Solid, draw, turned
from scenefw.representations.volumes import scene_volumes

_SAME = 0.01  # m: other machines round otherwise, but a pile that falls differently is another
_VIEW = Camera(320, 240, 380.0, 380.0, 159.5, 119.5, look_at((0.7, -0.9, 0.6), (0.0, 0.0, 0.1)))


class Stacks:
    """Pictures of scenes of a data set, and a few attempts simulated again.

    Args:
        scenes: the data set, all parts of it.
        source: made these scenes.
        output: the run's folder.
        shown: scenes to draw.
        simulated: scenes to simulate again; 0 = none.
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

    def show(self) -> tuple[tuple[Section, ...], dict[str, float]]:
        """A section, and figures: scenes, and how far those simulated again lie apart.

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
            words, check_figures = self._check()
            figures |= check_figures
        return (Section("Simulated stacks", (Text(words), picture)),), figures

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
        """Simulates the first scenes again; they must match the stored ones."""
        seed = int(str(self.scenes.manifest().get("seed", 0)))
        indices = self.scenes.indices[: self.simulated].tolist()
        try:
            scenes = [self.source.generate(index, seed) for index in indices]
        except MissingDependencyError as error:
            return f"No scene was simulated: {error}", {}
        gaps = [self._gap(row, scene) for row, scene in enumerate(scenes)]
        matching_gaps = [gap for gap in gaps if gap is not None]
        figures = {"stacks/simulated": float(len(scenes)), "stacks/same": float(len(matching_gaps))}
        words = (
            f"{len(scenes)} scenes were simulated again in this run; "
            f"{len(matching_gaps)} came out as stored"
        )
        if not matching_gaps:
            return f"{words}.", figures
        words += f", their objects at most {1000 * max(matching_gaps):.3g} mm apart."
        return words, figures | {"stacks/apart": max(matching_gaps)}

    def _gap(self, row: int, scene: Scene | None) -> float | None:
        """Largest distance (m) of an object to the stored one; None if it is another scene."""
        if scene is None:
            return None
        old = self.scenes.parameters([row])
        positions = np.array([item.pose.position for item in scene.objects])
        stored = old.positions[0][old.present[0]].numpy()
        if positions.shape != stored.shape:
            return None
        gap = float(np.linalg.norm(positions - stored, axis=-1).max())
        return gap if gap < _SAME else None
