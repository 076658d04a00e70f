"""The folder of a scene: meshes, numbers, masks, volumes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.core.versions import versions
from scenefw.export.masks import write_masks
from scenefw.export.meshes import write_glb, write_ply
from scenefw.export.summary import write_summary
from scenefw.export.surface_colours import surface_colours

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from scenefw.core.types import Float32, SceneEstimate
    from scenefw.export.meshes import Colour


def write_scene_files(
    folder: Path,
    estimate: SceneEstimate,
    colours: Sequence[Colour],
    spreads: Mapping[int, Float32] | None = None,
) -> None:
    """Writes meshes, `scene.glb`, `volumes.npz`, `masks.png` and `scene.json`.

    Meshes are `object_01.ply` ... and `obstacle_01.ply` ..., with the colours of the image where it
    has some (`surface_colours`).

    Args:
        folder: exists.
        estimate: the scene.
        colours: of its objects, in their order.
        spreads: of hypotheses at the vertices of objects (`surface_spread`), by id, if there are
            several; written as `spread` beside the vertices.

    Raises:
        StorageError: a file can't be written.
    """
    files = {item.id: f"object_{item.id:02d}.ply" for item in estimate.objects}
    paints = surface_colours(estimate, colours)
    for item, paint in zip(estimate.objects, paints, strict=True):
        write_ply(folder / files[item.id], item.mesh, paint, (spreads or {}).get(item.id))
    obstacle_files = [f"obstacle_{i:02d}.ply" for i in range(1, len(estimate.obstacles) + 1)]
    for name, obstacle in zip(obstacle_files, estimate.obstacles, strict=True):
        write_ply(folder / name, obstacle.mesh)
    write_glb(folder / "scene.glb", estimate, colours)
    if estimate.volumes:
        arrays: dict[str, Any] = dict(estimate.volumes)
        np.savez_compressed(folder / "volumes.npz", **arrays)
    if estimate.masks is not None:
        write_masks(folder / "masks.png", estimate.masks)
    write_summary(folder / "scene.json", estimate, files, obstacle_files, versions())
