"""The folder of a scene: meshes, numbers, masks, volumes."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.core.errors import StorageError
from scenefw.core.versions import versions
from scenefw.export.masks import write_masks
from scenefw.export.meshes import write_glb, write_ply
from scenefw.export.summary import write_summary

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.types import SceneEstimate
    from scenefw.export.meshes import Colour


def write_scene_files(folder: Path, estimate: SceneEstimate, colours: Sequence[Colour]) -> None:
    """Writes `object_01.ply` ..., `scene.glb`, `volumes.npz`, `masks.png` and `scene.json`.

    Args:
        folder: exists.
        estimate: the scene.
        colours: of its objects, in their order.

    Raises:
        StorageError: a file can't be written.
    """
    files = {item.id: f"object_{item.id:02d}.ply" for item in estimate.objects}
    for item, colour in zip(estimate.objects, colours, strict=True):
        write_ply(folder / files[item.id], item.mesh, colour)
    write_glb(folder / "scene.glb", estimate, colours)
    if estimate.volumes:
        arrays: dict[str, Any] = dict(estimate.volumes)
        np.savez_compressed(folder / "volumes.npz", **arrays)
    if estimate.masks is not None:
        write_masks(folder / "masks.png", estimate.masks)
    write_summary(folder / "scene.json", estimate, files, versions())


@contextmanager
def replacing_folder(target: Path) -> Iterator[Path]:
    """Yields a temporary folder beside `target` which takes its place when the block ends well.

    Raises:
        StorageError: the folder can't be written.
    """
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    except OSError as error:
        raise _unwritable(target, error) from error
    try:
        new = temporary / target.name
        new.mkdir()
        yield new
        if target.exists():
            target.rename(temporary / "old")
        new.rename(target)
    except OSError as error:
        raise _unwritable(target, error) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _unwritable(target: Path, error: OSError) -> StorageError:
    reason = error.strerror or str(error)
    return StorageError(f"cannot write {target}: {reason}; choose a writable paths.output=FOLDER")
