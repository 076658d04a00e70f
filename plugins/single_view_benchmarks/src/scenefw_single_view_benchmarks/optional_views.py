"""Families of annotated images whose files may not be there: without a path there is none."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from scenefw.core.errors import ConfigError
from scenefw.data.batches.mesh_stacks import scene_set
from scenefw_annotated_views.scenes import StackViews
from scenefw_single_view_benchmarks.posed_images import PosedImages

if TYPE_CHECKING:
    from collections.abc import Mapping

    from scenefw.core.protocols import Noise
    from scenefw.data.batches.views import Viewpoints


def stack_views(
    path: str | None,
    split: str,
    limit: int | None,
    viewpoints: Viewpoints,
    noise: Mapping[str, Noise] | None = None,
    seed: int = 0,
) -> StackViews | None:
    """Views of stacks.

    Args:
        path: a file, or the name of a data set that ships; None: there are no views.
        split: part of the data; of meshes that are for tests alone, `test`.
        limit: scenes at most.
        viewpoints: draw cameras.
        noise: disturbs depth.
        seed: of the views.
    """
    if path is None:
        return None
    return StackViews(scene_set(path, split, limit), viewpoints, split, noise, seed)


def posed_images(folder: str | None, meshes: str | None) -> PosedImages | None:
    """Images with poses.

    Args:
        folder: of the images; None: there are none.
        meshes: folder of the meshes of their objects.
    """
    return None if folder is None else PosedImages(folder, meshes)


def posed_folder(folder: str | None) -> PosedImages:
    """Images with poses of a folder that holds `images` (NAME.npz) and `meshes` (NAME.ply).

    Raises:
        ConfigError: no folder is given.
        InputError: an image or a mesh is missing.
    """
    if folder is None:
        raise ConfigError("posed images need input=FOLDER that holds images/ and meshes/")
    return PosedImages(Path(folder) / "images", str(Path(folder) / "meshes"))
