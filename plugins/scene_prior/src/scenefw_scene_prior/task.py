"""Draws whole scenes from a trained prior."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from scenefw.core.errors import ConfigError
from scenefw.core.files import require_writable
from scenefw.core.folders import replacing_folder
from scenefw.core.protocols import SceneFormat
from scenefw.core.types import SceneEstimate
from scenefw.report.page import write_scene_page
from scenefw.report.palette import colours_of
from scenefw.report.pictures import save_picture
from scenefw.report.scenes3d import Scene3D, layer, packed
from scenefw.tasks.scene_files import write_scene
from scenefw_scene_prior.pictures import draw_scenes
from scenefw_scene_prior.prior import ScenePrior

_SHOWN = 12  # scenes in the picture and on the page


class DrawScenes:
    """Writes scenes that nobody has seen: a folder for each, as of `run=predict`.

    The folder `drawn` holds `scene_001` ... with `scene.json`, `scene.glb` and a PLY per object,
    `drawn.png` with the first of them from front and back, and `drawn.html` to turn them in a
    browser. It appears when all of it is written. What reads predictions reads these too:
    `run=edit`, `run=view`, exports.

    Args:
        prior: draws them.
        count: of scenes.
        output: where the folder goes.
        exports: what writes further files of each scene, by name.
        seed: of the draws.
        overview: also draw `drawn.png`.
        page: also write `drawn.html`.

    Raises:
        ConfigError: the count is below one.
    """

    def __init__(
        self,
        prior: ScenePrior,
        count: int = 8,
        output: str | Path = "outputs",
        exports: Mapping[str, SceneFormat] | None = None,
        seed: int = 0,
        *,
        overview: bool = True,
        page: bool = True,
    ) -> None:
        if count < 1:
            raise ConfigError(f"run.count is {count}: expected 1 or more")
        self.prior, self.count, self.output = prior, count, Path(output)
        self.exports, self.seed = dict(exports or {}), seed
        self.overview, self.page = overview, page

    def run(self) -> dict[str, float]:
        """Draws and writes; returns how many scenes, draws per scene and objects per scene.

        Raises:
            ConfigError: no draw of a scene stands.
            StorageError: the folder can't be written.
        """
        from rich.progress import track

        require_writable(self.output)
        folder = self.output / "drawn"
        examples: list[SceneEstimate] = []
        draws = objects = 0
        with replacing_folder(folder) as temporary:
            scenes = self.prior.scenes(self.count, self.seed)
            for scene in track(scenes, "scenes", total=self.count):
                self._write(temporary / scene.frame.name, scene)
                examples += [scene] if len(examples) < _SHOWN else []
                draws += int(scene.details["drawn"]["draws"])
                objects += len(scene.objects)
            if self.overview:
                save_picture(draw_scenes(examples), temporary / "drawn.png")
            if self.page:
                pages = [
                    Scene3D(
                        example.frame.name,
                        (layer("drawn", example, colours_of(example)),),
                        example.frame,
                    )
                    for example in examples
                ]
                write_scene_page(temporary / "drawn.html", "drawn scenes", packed(pages))
        print(folder)
        return {
            "scenes": float(self.count),
            "draws_per_scene": draws / self.count,
            "objects_per_scene": objects / self.count,
        }

    def _write(self, folder: Path, scene: SceneEstimate) -> None:
        folder.mkdir()
        write_scene(folder, scene, self.exports)
