"""Which class writes which kind of file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenefw.core.errors import InputError
from scenefw.export.mjcf import MJCF
from scenefw.export.scene_files import GLB, OBJ, PLY, Summary
from scenefw.export.superquadrics import Superquadrics
from scenefw.export.urdf import URDF

if TYPE_CHECKING:
    from scenefw.core.protocols import SceneFormat

_FORMATS: dict[str, type[Any]] = {
    one.suffix: one for one in (GLB, PLY, OBJ, Superquadrics, Summary, URDF, MJCF)
}


def writer(path: Path, settings: dict[str, Any]) -> SceneFormat:
    """What writes a file of this name.

    Args:
        path: its suffix counts, the longer of two.
        settings: arguments of the class.

    Raises:
        InputError: an unknown suffix or setting.
    """
    named = [made for suffix, made in _FORMATS.items() if path.name.lower().endswith(suffix)]
    if not named:
        raise InputError(
            f"no format writes '{path.suffix}' of {path}; give one of {', '.join(_FORMATS)}"
        )
    try:
        written: SceneFormat = named[0](**settings)
    except TypeError as error:
        raise InputError(f"{path.suffix} files: {error}; see docs/api.md") from error
    return written
