"""Edits a predicted scene by words, and writes it as a prediction is written."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from scenefw.core.errors import ConfigError
from scenefw.core.files import require_writable
from scenefw.core.folders import replacing_folder, require_replaceable
from scenefw.core.protocols import SceneFormat, Settling
from scenefw.core.settled import words as settled_words
from scenefw.core.types import SceneEstimate
from scenefw.report.blocks import Section
from scenefw.report.console import print_tables
from scenefw.report.page import write_scene_page
from scenefw.report.palette import colours_of
from scenefw.report.pictures import save_picture
from scenefw.report.scenes3d import Scene3D, layer, packed
from scenefw.tasks.scene_files import write_scene
from scenefw_editing.contact_words import contact_words
from scenefw_editing.edit_words import USAGES, edited
from scenefw_editing.pictures import draw_edited, object_table
from scenefw_editing.scene_editing import with_objects
from scenefw_editing.stored_scenes import read_scene

_END = "_edited"


class Edit:
    """Changes the objects of a scene, one edit after the other.

    The result is a folder as of `run=predict`, NAME_edited: `scene.json`, `scene.glb`, a PLY per
    object, `scene.html` with the scene before and after, and `edited.png`. It appears when all of
    it is written. Without edits the objects are listed, and nothing is written.

    Args:
        input: `scene.json` of a prediction, or the folder that holds it.
        edits: in words, such as `move 1 0.1 0 0`; see `edit_words`.
        output: where the folder goes.
        settling: lets the objects come to rest afterwards; None leaves them where they are.
        exports: what writes further files of the scene, by name.
        tolerance: objects that touch may run into each other, or hover, by this much without a
            warning (m).
        overview: also draw `edited.png`.
        page: also write `scene.html`.

    Raises:
        ConfigError: no input is given, or the tolerance is negative.
    """

    def __init__(
        self,
        input: str | Path | None,  # noqa: A002 - named as the setting on the command line
        edits: Sequence[str] = (),
        output: str | Path = "outputs",
        settling: Settling | None = None,
        exports: Mapping[str, SceneFormat] | None = None,
        tolerance: float = 0.005,
        *,
        overview: bool = True,
        page: bool = True,
    ) -> None:
        if input is None:
            raise ConfigError("run=edit needs input=PATH of a scene.json that run=predict wrote")
        if not tolerance >= 0:
            raise ConfigError(f"run.tolerance = {tolerance}: expected metres, 0 or more")
        self.input, self.output = Path(input), Path(output)
        self.edits = [str(edit) for edit in edits]
        self.settling, self.tolerance = settling, tolerance
        self.exports, self.overview, self.page = dict(exports or {}), overview, page

    def run(self) -> dict[str, float]:
        """Edits and writes; returns how many objects there are, and how many warnings.

        Raises:
            InputError: the scene can't be read, or an edit makes no sense.
            StorageError: the folder can't be written.
        """
        before = _read(self.input)
        if not self.edits and self.settling is None:
            print_tables([Section("", (object_table(before),))])
            print("edits: " + "; ".join(USAGES.values()))
            print(self.input)
            return {"objects": float(len(before.objects))}
        require_writable(self.output)
        folder = self.output / f"{_name(before, self.input)}{_END}"
        require_replaceable(folder)
        after, problems = self.edit(before)
        print_tables([Section("", (object_table(after),))])
        for warning in problems:
            print(f"warning: {warning}", file=sys.stderr)
        with replacing_folder(folder) as temporary:
            self._write(temporary, before, after)
        print(folder)
        return {"objects": float(len(after.objects)), "warnings": float(len(problems))}

    def edit(self, before: SceneEstimate) -> tuple[SceneEstimate, list[str]]:
        """The scene after all edits, and what looks wrong about it.

        Raises:
            InputError: an edit makes no sense.
        """
        objects = before.objects
        for words in self.edits:
            objects = edited(objects, words, _read)
        after = with_objects(before, objects)
        if self.settling is not None:
            after = self.settling.settle([after])[0]
            after = replace(with_objects(before, after.objects), details=after.details)
            print(settled_words(after))
        warnings = contact_words(after.objects, self.tolerance)
        details = {**after.details, "edits": self.edits, "warnings": warnings}
        return replace(after, details=details), warnings

    def _write(self, folder: Path, before: SceneEstimate, after: SceneEstimate) -> None:
        colours = write_scene(folder, after, self.exports)
        if self.page:
            layers = (layer("edited", after, colours), layer("before", before, colours_of(before)))
            name = after.frame.name or "scene"
            scene = Scene3D(name, layers, after.frame, after.obstacles)
            write_scene_page(folder / "scene.html", name, packed([scene]))
        if self.overview:
            save_picture(draw_edited(before, after), folder / "edited.png")


def _read(path: str | Path) -> SceneEstimate:
    """A scene; what of it isn't known here is told in a line each."""
    with warnings.catch_warnings(record=True) as records:
        warnings.simplefilter("always")
        scene = read_scene(path)
    for record in records:
        print(f"warning: {record.message}", file=sys.stderr)
    return scene


def _name(scene: SceneEstimate, path: Path) -> str:
    """Of the folder: the scene's, or that of the folder that it is in."""
    folder = (path if path.is_dir() else path.parent).resolve()
    return (Path(scene.frame.name).name or folder.name).removesuffix(_END) or "scene"
