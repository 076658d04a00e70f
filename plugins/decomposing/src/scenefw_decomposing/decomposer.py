"""Takes whole scenes apart: meshes, recordings, or depth images given as arrays."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence, Sized
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenefw.api.prediction import Prediction
from scenefw.api.settings import Settings
from scenefw.core.errors import InputError, require_number
from scenefw.core.settings import POSITIVE
from scenefw.data.files.arrays import frame_of
from scenefw.data.files.poses import require_metres
from scenefw_decomposing.whole_scenes import (
    WholeScene,
    distant_views,
    read_whole_scene,
    taken_apart,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from scenefw.data.files.intrinsics import Intrinsics
    from scenefw.perception.observation.views import Views
    from scenefw.perception.pipeline import ReconstructionPipeline
    from scenefw_decomposing.mesh_views import MeshViews


class Decomposer:
    """What `scenefw.load("decomposing")` gives.

    Args:
        pipeline: takes views apart.
        meshes: makes views of meshes.
        max_views: of a scene that are used.
        computing: threads compute within what it returns.
    """

    def __init__(
        self,
        pipeline: ReconstructionPipeline[Views],
        meshes: MeshViews,
        max_views: int = 8,
        computing: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> None:
        self.pipeline, self.meshes, self.max_views = pipeline, meshes, max_views
        self._computing = computing

    @classmethod
    def built(cls, words: Sequence[str]) -> Decomposer:
        """The decomposer of `run=decompose` with these overrides."""
        settings = Settings(["run=decompose", *words])
        pipeline, meshes = settings.build("run.pipeline", "run.meshes")
        return cls(pipeline, meshes, settings.config.run.max_views, settings.computing)

    def decompose(
        self,
        scene: str | Path | Sequence[ArrayLike],
        intrinsics: Intrinsics | None = None,
        poses: Sequence[ArrayLike] | None = None,
        *,
        depth_scale: float | None = None,
        mesh_scale: float = 1.0,
        name: str = "scene",
    ) -> Prediction:
        """The objects of a whole scene, as `run=decompose` finds them; it has one sample.

        What looks odd is warned of, and in `warnings`. `estimate.details["T_world_input"]` (4, 4)
        takes coordinates of the input to those of the objects.

        Args:
            scene: path of a mesh, of an RGB-D folder or of a sequence in TUM's format; or depth
                images (H, W) as of `scenefw.load("reconstruction").predict`.
            intrinsics: of all images; of a folder, None or the path of a file.
            poses: camera to world (4, 4) of each image, in one world (OpenCV: x right, y down).
            depth_scale: metres per unit of integer depth; None = 0.001, or that of the format.
            mesh_scale: metres per unit of a mesh.
            name: of a scene given as arrays.

        Raises:
            InputError: the scene is unusable; the message says how to fix it.
        """
        require_number(depth_scale, "depth_scale", "metres per unit of integer depth, or None")
        require_number(mesh_scale, "mesh_scale", "metres per unit of a mesh")
        POSITIVE.require(mesh_scale=mesh_scale)
        with self._computing():
            whole_scene = (
                self._read(scene, intrinsics, poses, depth_scale, mesh_scale)
                if isinstance(scene, str | Path)
                else self._posed(scene, intrinsics, poses, depth_scale, name)
            )
            views = self.pipeline.observe(whole_scene.frames)
            for warning in (*whole_scene.warnings, *views.warnings):
                warnings.warn(f"{whole_scene.name}: {warning}", stacklevel=2)
            return Prediction((taken_apart(whole_scene, views, self.pipeline),))

    def _read(
        self,
        path: str | Path,
        intrinsics: Intrinsics | None,
        poses: Sequence[ArrayLike] | None,
        depth_scale: float | None,
        mesh_scale: float,
    ) -> WholeScene:
        if poses is not None or not (intrinsics is None or isinstance(intrinsics, str | Path)):
            raise InputError(
                f"{path} brings its poses and intrinsics; leave both out, or give a file of "
                "intrinsics"
            )
        options: dict[str, Any] = {"intrinsics": intrinsics, "largest_jump": None}
        if depth_scale is not None:
            options["depth_scale"] = depth_scale
        path = Path(path).expanduser()
        return read_whole_scene(path, self.meshes, mesh_scale, self.max_views, options)

    def _posed(
        self,
        images: Sequence[ArrayLike],
        intrinsics: Intrinsics | None,
        poses: Sequence[ArrayLike] | None,
        depth_scale: float | None,
        name: str,
    ) -> WholeScene:
        for value in (images, [] if poses is None else poses):
            if not isinstance(value, Sized):
                raise InputError(
                    f"got a {type(value).__name__}; give a path, or a list of depth images, K, and "
                    "a list of poses"
                )
        if intrinsics is None or poses is None or len(poses) != len(images):
            count = 0 if poses is None else len(poses)
            phrase = "no intrinsics" if intrinsics is None else "intrinsics"
            raise InputError(
                f"{len(images)} depth images of {name} came with {count} poses and {phrase}; give "
                "K (3, 3), and a pose (4, 4) of each, camera to world"
            )
        frames = [
            frame_of(
                depth,
                intrinsics,
                depth_scale=depth_scale,
                pose=pose,
                name=f"{name}, view {number}",
            )
            for number, (depth, pose) in enumerate(zip(images, poses, strict=True), start=1)
        ]
        cameras = [frame.camera.T_world_camera for frame in frames]
        require_metres(cameras, name)
        numbers = distant_views(cameras, self.max_views)
        return WholeScene(name, [frames[number] for number in numbers])
