"""The depth images that a run is given, how they are read, and the masks that belong to them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenefw.core.assets import image_path
from scenefw.core.errors import ConfigError
from scenefw.core.files import require_apart
from scenefw.core.settings import POSITIVE
from scenefw.data.files.arrays import read_mask
from scenefw.data.files.image_poses import folder_poses
from scenefw.data.files.lens import undistorted
from scenefw.data.files.readers import find_images, lens_of_image, read_frame

if TYPE_CHECKING:
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
        masks: folder of masks of objects, NAME.png for each image, or such a file (see
            `data.files.arrays.read_mask`); None = none are known.
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

    def poses(self) -> dict[Path, NDArray[np.float64] | None]:
        """4x4 pose of the camera of each image, as the files of a recording say; empty without.

        What they leave open is printed.

        Raises:
            InputError: they are unusable, or not those of the images.
        """
        images = self.find()
        poses = folder_poses(self.path, images, require=False) if self.path.is_dir() else None
        if poses is None:
            return {}
        for note in poses.notes:
            print(note, file=sys.stderr)
        return dict(zip(images, poses.poses, strict=True))

    def name(self, image: Path) -> Path:
        """Of an image below the input."""
        return image.relative_to(self.path if self.path.is_dir() else self.path.parent)

    def read(self, image: Path) -> tuple[Frame, Any]:
        """A frame, and its mask (H, W) or None.

        Raises:
            InputError: either is unusable.
        """
        frame = read_frame(image, **self._options)
        if self._masks is None:
            return frame, None
        path = self._masks / f"{image.stem}.png" if self._masks.is_dir() else self._masks
        mask = read_mask(path, frame.depth.shape)
        lens = lens_of_image(image, self._options["intrinsics"])
        if lens is None:
            return frame, mask
        return frame, undistorted(lens, frame.camera.matrix, [frame.depth, mask], image.name)[1]
