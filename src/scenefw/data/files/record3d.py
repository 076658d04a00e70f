"""What Record3D's exports of EXR images say of their cameras (`metadata.json`)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scenefw.core.errors import InputError
from scenefw.core.types import Float64
from scenefw.data.files.intrinsics import Calibration
from scenefw.data.files.poses import PoseReader
from scenefw.data.files.structured import read_structured

FILE = "metadata.json"
_ARKIT_CAMERA = np.diag([1.0, -1.0, -1.0, 1.0])  # y up, z backward


def record3d_calibration(folders: Iterable[Path], image: Path) -> Calibration | None:
    """The camera of colour, which depth has in fewer pixels; None if there is no such file.

    Raises:
        InputError: the file is damaged.
    """
    for folder in folders:
        content = _content(folder / FILE)
        if content is None:
            continue
        try:
            matrix = np.array(content["K"], np.float64).reshape(3, 3).T  # column by column
            per_image = content.get("perFrameIntrinsicCoeffs") or []
            if image.stem.isdigit() and int(image.stem) < len(per_image):
                fx, fy, cx, cy = per_image[int(image.stem)]
                matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], np.float64)
            return Calibration(matrix, (int(content["w"]), int(content["h"])))
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise _damaged(folder, error) from error
    return None


def record3d_poses(
    folder: Path, images: Sequence[Path], reader: PoseReader
) -> list[Float64 | None] | None:
    """Camera to world (4, 4), OpenCV's axes, of images named by their numbers; None: no such file.

    Args:
        folder: with the file.
        images: in order.
        reader: of the poses; one that isn't finite is None.

    Raises:
        InputError: the file is damaged, or has no pose of an image.
    """
    content = _content(folder / FILE)
    if content is None or "poses" not in content:
        return None
    try:
        lines = [[float(x) for x in content["poses"][int(image.stem)]] for image in images]
    except (LookupError, TypeError, ValueError) as error:
        raise _damaged(folder, error) from error
    poses = []
    for image, line in zip(images, lines, strict=True):
        words = [f"{value!r}" for value in (*line[4:7], *line[:4])]
        pose = reader.read(words, image.stem, f"the pose of {image.stem} in {folder / FILE}")
        poses.append(None if pose is None else pose @ _ARKIT_CAMERA)
    return poses


def _content(path: Path) -> dict[str, Any] | None:
    content = read_structured(path) if path.is_file() else None
    return content if isinstance(content, dict) and {"K", "w", "h"} <= content.keys() else None


def _damaged(folder: Path, error: Exception) -> InputError:
    return InputError(
        f"{folder / FILE} is none of Record3D ({type(error).__name__}: {error}); expected K (9 "
        "numbers, column by column), w, h, and for recordings poses (qx qy qz qw x y z of each)"
    )
