"""The files of one scene, with those of further formats."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenefw.export.scene_folder import write_scene_files
from scenefw.perception.estimate.base_frame import in_base
from scenefw.report.palette import Colour, colours_of

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from scenefw.core.protocols import SceneFormat
    from scenefw.core.types import SceneEstimate


def write_scene(
    folder: Path, estimate: SceneEstimate, exports: Mapping[str, SceneFormat]
) -> list[Colour]:
    """Writes a scene into a folder, also as `scene.urdf` and so on; returns its objects' colours.

    Args:
        folder: exists.
        estimate: the scene.
        exports: what writes further files, by name.

    Raises:
        StorageError: a file can't be written.
    """
    colours, estimate = colours_of(estimate), in_base(estimate)
    write_scene_files(folder, estimate, colours)
    for form in exports.values():
        form.write(folder / f"scene{form.suffix}", estimate, colours)
    return colours
