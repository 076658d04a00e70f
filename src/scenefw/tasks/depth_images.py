"""The depth images that a run is given, how they are read, and the masks that belong to them."""

from __future__ import annotations

import sys
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenefw.core.assets import image_path
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.files import require_apart
from scenefw.core.settings import POSITIVE
from scenefw.data.files.arrays import read_mask
from scenefw.data.files.image_poses import folder_poses
from scenefw.data.files.pose_conventions import OPENCV, check_conventions, converted
from scenefw.data.files.poses import require_metres
from scenefw.data.files.readers import find_images, read_frame
from scenefw.data.files.sequences import open_sequence

if TYPE_CHECKING:
    from collections.abc import Iterable

    import numpy as np
    from numpy.typing import NDArray

    from scenefw.core.types import Frame


class DepthImages:
    """A depth image or a folder of them.

    Args:
        verb: of the run, for messages.
        path: of the image or the folder; `example` is the image that comes with scenefw.
        intrinsics: file with the intrinsics of .png and .npy images; None looks beside them.
        depth_scale: metres per unit of integer depth; None = that of the format, else millimetres.
        masks: folder of masks of objects, at the path of each image below the input, or NAME.png,
            or such a file (see `data.files.arrays.read_mask`); None = none are known.
        output: where results go, not among the images; None = nowhere.

    Raises:
        ConfigError: no path is given, the depth scale is not positive, or results would go among
            the images.
    """

    def __init__(
        self,
        verb: str,
        path: str | Path | None,
        intrinsics: str | Path | None = None,
        depth_scale: float | None = None,
        masks: str | Path | None = None,
        output: str | Path | None = None,
    ) -> None:
        if path is None:
            raise ConfigError(f"run={verb} needs input=PATH of a depth image or a folder of them")
        POSITIVE.require(depth_scale=depth_scale)
        if output is not None:
            require_apart(output, path)
        self.path = image_path(path)
        self._options: dict[str, Any] = {"intrinsics": intrinsics, "depth_scale": depth_scale}
        self._masks = None if masks is None else Path(masks)

    def find(self) -> list[Path]:
        """All images, in their order.

        Raises:
            InputError: there is none.
        """
        return find_images(self.path)

    def poses(self, convention: str = OPENCV) -> dict[Path, NDArray[np.float64]]:
        """4x4 pose of the camera of each image, as the files of a recording say; empty without.

        What they leave open is printed.

        Args:
            convention: of the poses, as `pose_conventions.converted` takes it.

        Raises:
            InputError: they are unusable, of another convention, or not those of the images.
        """
        if not self.path.is_dir():
            return {}
        if (self.path / "groundtruth.txt").is_file():
            options = {**self._options, "poses": convention, "largest_jump": None}
            sequence = open_sequence(self.path, **options)
            _print_all(sequence.notes)
            return dict(zip(sequence.depth_files, sequence.poses, strict=True))
        images = self.find()
        poses = folder_poses(self.path, images, require=False)
        if poses is None:
            return {}
        posed = {image: pose for image, pose in zip(images, poses.poses, strict=True)
                 if pose is not None}  # fmt: skip
        names, matrices = [image.stem for image in posed], list(posed.values())
        views = _Views(self, list(posed))
        _print_all(poses.notes)
        _print_all(check_conventions(views, matrices, names, str(self.path), convention))
        camera_poses = [converted(pose, convention) for pose in matrices]
        require_metres(camera_poses, str(self.path))
        return dict(zip(posed, camera_poses, strict=True))

    def name(self, image: Path) -> Path:
        """Of an image below the input."""
        return image.relative_to(self.path if self.path.is_dir() else self.path.parent)

    def frame(self, image: Path) -> Frame:
        """A frame without its mask.

        Raises:
            InputError: it is unusable.
        """
        return read_frame(image, **self._options)

    def read(self, image: Path) -> tuple[Frame, Any]:
        """A frame, and its mask (H, W) or None.

        Raises:
            InputError: either is unusable.
        """
        frame = self.frame(image)
        if self._masks is None:
            return frame, None
        path = self._mask_file(image) if self._masks.is_dir() else self._masks
        mask = read_mask(path, frame.depth.shape)
        return frame, mask if frame.undistort is None else frame.undistort(mask)

    @cached_property
    def _paths(self) -> list[Path]:
        return self.find()

    def _mask_file(self, image: Path) -> Path:
        """The mask of an image: of its path below the input, else of its name, if that is unique.

        Raises:
            InputError: images of several folders have this name.
        """
        assert self._masks is not None
        exact = (self._masks / self.name(image)).with_suffix(".png")
        if exact.is_file():
            return exact
        twin = next((i for i in self._paths if i.stem == image.stem and i != image), None)
        if twin is not None:
            raise InputError(
                f"{image.stem}.png in {self._masks} may be of {self.name(image)} or "
                f"{self.name(twin)}; give masks at these paths, as {exact}"
            )
        return self._masks / f"{image.stem}.png"


class _Views:
    """Frames of some images, by number."""

    def __init__(self, images: DepthImages, paths: list[Path]) -> None:
        self._images, self._paths = images, paths

    def __getitem__(self, index: int) -> Frame:
        return self._images.frame(self._paths[index])


def _print_all(notes: Iterable[str]) -> None:
    for note in notes:
        print(note, file=sys.stderr)
