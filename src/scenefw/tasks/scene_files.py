"""The files of one scene, with those of further formats."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenefw.export.scene_folder import write_scene_files
from scenefw.perception.estimate.base_frame import in_base
from scenefw.perception.estimate.surface_spread import surface_spread
from scenefw.report.palette import Colour, colours_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from scenefw.core.protocols import SceneFormat
    from scenefw.core.types import SceneEstimate


def write_scene(
    folder: Path,
    estimate: SceneEstimate,
    exports: Mapping[str, SceneFormat],
    alternatives: Sequence[SceneEstimate] = (),
) -> list[Colour]:
    """Writes a scene into a folder, also as `scene.urdf` and so on; returns its objects' colours.

    Args:
        folder: exists.
        estimate: the scene.
        exports: what writes further files, by name.
        alternatives: other hypotheses of it; how far they differ is written beside the vertices.

    Raises:
        StorageError: a file can't be written.
    """
    spreads = surface_spread(estimate, alternatives)
    colours, estimate = colours_of(estimate), in_base(estimate)
    write_scene_files(folder, estimate, colours, spreads)
    for form in exports.values():
        form.write(folder / f"scene{form.suffix}", estimate, colours)
    return colours
