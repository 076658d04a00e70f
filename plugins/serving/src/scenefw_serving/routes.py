"""What the service answers about an image."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.settings import COUNT
from scenefw.core.versions import versions
from scenefw.export.masks import write_masks
from scenefw.export.meshes import write_glb
from scenefw.export.summary import plain, summarise
from scenefw.perception.estimate.base_frame import in_base
from scenefw.perception.ranking.next_view import next_views_in_base
from scenefw.report.palette import colours_of
from scenefw.tasks.scene_files import write_scene
from scenefw_serving.uploads import in_fields

if TYPE_CHECKING:
    from scenefw.core.protocols import SceneFormat, Settling
    from scenefw.core.types import SceneEstimate
    from scenefw_doctor.examination import Examiner
    from scenefw_serving.image_request import ImageRequest

SCENE_FORMATS = {
    "json": "application/json",
    "glb": "model/gltf-binary",
    "masks": "image/png",
    "zip": "application/zip",
}


class Reconstruct:
    """Answers with the scene of an image, as `run=predict` finds it.

    `json` is `scene.json`, `masks` a PNG of 16 bits, `zip` the folder of `run=predict` without its
    pictures, further hypotheses in `hypothesis_2` ...

    Args:
        exports: what writes further files into the zip, by name.
    """

    path = "/reconstruct"
    summary = "Complete objects of a depth image"
    formats: Mapping[str, str] = SCENE_FORMATS

    def __init__(self, exports: Mapping[str, SceneFormat] | None = None) -> None:
        self.exports = dict(exports or {})

    def answer(self, image: ImageRequest, form: str) -> bytes | Mapping[str, Any]:
        """The scene in a format; `zip` has all hypotheses.

        Raises:
            InputError: the image is unusable, or a format doesn't fit the scene.
        """
        return content(image, image.scenes(), form, self.exports)


class Settle:
    """Answers as `/reconstruct`, with the objects at rest.

    Args:
        settling: lets them come to rest.
        exports: what writes further files into the zip, by name.

    Raises:
        ConfigError: nothing settles.
    """

    path = "/settle"
    summary = "Complete objects of a depth image, at rest in a simulation"
    formats: Mapping[str, str] = SCENE_FORMATS

    def __init__(
        self,
        settling: Settling | None = None,
        exports: Mapping[str, SceneFormat] | None = None,
    ) -> None:
        if settling is None:
            raise ConfigError("route=settle needs settling=physics; or leave it out of route=[...]")
        self.settling, self.exports = settling, dict(exports or {})

    def answer(self, image: ImageRequest, form: str) -> bytes | Mapping[str, Any]:
        """The settled scene in a format.

        Raises:
            InputError: as `Reconstruct.answer`.
            MissingDependencyError: the simulator is not installed.
        """
        return content(image, self.settling.settle(image.scenes()), form, self.exports)


class NextView:
    """Answers where to look next.

    Args:
        count: of the views all around that are compared.
        best: of them that are told.

    Raises:
        SettingError: a number below 1.
    """

    path = "/next_view"
    summary = "Views that would tell the hypotheses of a depth image apart, the best one first"
    formats: Mapping[str, str] = {"json": "application/json"}

    def __init__(self, count: int = 48, best: int = 5) -> None:
        COUNT.require(count=count, best=best)
        self.count, self.best = count, best

    def answer(self, image: ImageRequest, form: str) -> bytes | Mapping[str, Any]:
        """`views`, each with `T_world_camera` and `score`.

        Raises:
            InputError: the image is unusable.
        """
        views = next_views_in_base(image.scenes(), count=self.count)[: self.best]
        answers = [{"T_world_camera": plain(v.T_world_camera), "score": v.score} for v in views]
        return {"name": image.frame.name, "views": answers}


class Diagnose:
    """Answers with the checks of `run=doctor`; an unusable image is an answer, too.

    Args:
        examiner: makes the checks.
    """

    path = "/doctor"
    summary = "Checks of a depth image before a prediction, with what helps"
    formats: Mapping[str, str] = {"json": "application/json"}

    def __init__(self, examiner: Examiner) -> None:
        self.examiner = examiner

    def answer(self, image: ImageRequest, form: str) -> bytes | Mapping[str, Any]:
        """`usable`, and `checks` with name, verdict, found and fix."""
        examination = self.examiner.examine(image.frame, image.mask)
        checks = [
            {
                "name": check.name,
                "verdict": check.verdict,
                "found": check.found,
                "fix": in_fields(check.fix),
            }
            for check in examination.checks
        ]
        return {"name": image.frame.name, "usable": examination.usable, "checks": checks}


def content(
    image: ImageRequest,
    scenes: Sequence[SceneEstimate],
    form: str,
    exports: Mapping[str, SceneFormat],
) -> bytes | Mapping[str, Any]:
    """Scenes in one of `SCENE_FORMATS`.

    Args:
        image: says which of the scenes; `zip` has all.
        scenes: of the image.
        form: a name of `SCENE_FORMATS`.
        exports: what writes further files into the zip, by name.

    Raises:
        InputError: there is no such scene, or it has no masks.
    """
    scene = image.chosen(scenes)
    colours, in_frame = colours_of(scene), in_base(scene)
    if form == "json":
        return summarise(in_frame, {}, versions=versions())
    with TemporaryDirectory() as name:
        folder = Path(name)
        if form == "zip":
            return _packed(folder, scenes, exports)
        file = folder / form
        if form == "glb":
            write_glb(file, in_frame, colours)
        elif scene.masks is not None:
            write_masks(file.with_suffix(".png"), scene.masks)
            file = file.with_suffix(".png")
        else:
            raise InputError("this reconstructor makes no masks; ask for format=json, glb or zip")
        return file.read_bytes()


def _packed(
    folder: Path, scenes: Sequence[SceneEstimate], exports: Mapping[str, SceneFormat]
) -> bytes:
    for number, scene in enumerate(scenes, start=1):
        place = folder if number == 1 else folder / f"hypothesis_{number}"
        place.mkdir(exist_ok=True)
        write_scene(place, scene, exports, scenes[1:] if number == 1 else ())
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(folder.rglob("*")):
            if file.is_file():
                archive.write(file, file.relative_to(folder))
    return packed.getvalue()
