"""Files and pictures of a scene."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.api.formats import writer
from scenefw.core.errors import InputError
from scenefw.core.folders import replacing_folder
from scenefw.core.types import Camera
from scenefw.export.scene_folder import write_scene_files
from scenefw.perception.estimate.base_frame import in_base
from scenefw.report.palette import colours_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import SceneEstimate


def save(estimate: SceneEstimate, path: str | Path, settings: dict[str, Any]) -> Path:
    """Writes a scene; the suffix chooses the format.

    Args:
        estimate: in the frame of its floor.
        path: as of `Prediction.save`.
        settings: of the format.

    Raises:
        InputError: an unknown suffix or setting.
        StorageError: the file can't be written.
    """
    path, colours = Path(path).expanduser(), colours_of(estimate)
    estimate = in_base(estimate)
    if path.suffix or settings:
        writer(path, settings).write(path, estimate, colours)
        return path
    with replacing_folder(path) as folder:
        write_scene_files(folder, estimate, colours)
    return path


def render(
    estimate: SceneEstimate, camera: Camera | None = None, turn: float = 0.0
) -> NDArray[np.uint8]:
    """A picture, RGB (H, W, 3) uint8, every object in its colour.

    Args:
        estimate: the scene.
        camera: from where; None = the image's own.
        turn: degrees to go around the objects from there; then they fill the picture.

    Raises:
        InputError: what was given is no camera.
    """
    from scenefw.report.shading import draw, turned
    from scenefw.report.solids import solid_of
    from scenefw.report.window import by_label, vertices

    camera = camera or estimate.frame.camera
    if not isinstance(camera, Camera):
        raise InputError(
            f"render takes a scenefw.core.types.Camera, got a {type(camera).__name__}; leave "
            "it out for the image's own, and give turn=150 to look from behind"
        )
    if turn:
        camera = turned(camera, vertices(estimate), turn)
    colours = by_label(estimate, colours_of(estimate))
    solid = solid_of(estimate, colours)
    return np.rint(np.clip(draw(solid, camera), 0, 1) * 255).astype(np.uint8)
