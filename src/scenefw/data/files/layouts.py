"""Folders around depth images that say more of them: BOP scenes, TUM sequences, RGB-D folders."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import InputError
from scenefw.data.files.intrinsics import read_calibration
from scenefw.data.files.record3d import record3d_calibration
from scenefw.data.files.structured import read_text
from scenefw.data.files.timed_lines import nearest_times, timed_lines

MILLIMETRES = 0.001
"""Metres per unit of integer depth where nothing says otherwise."""

TUM_UNIT = 1 / 5000
"""Metres per unit in the TUM RGB-D benchmark."""

SCANNET_COLOUR = "intrinsic/intrinsic_color.txt"

_MOST_DELAY = 0.02  # s
_COLOURS = ("rgb", "colour", "color", "gray")
_IMAGES = (".png", ".jpg", ".jpeg")


@dataclass(frozen=True)
class Surroundings:
    """What the folder of an image says.

    Args:
        scale: metres per unit of integer depth.
        root: folder of the recording; intrinsics may lie there.
        matrix: intrinsics (3, 3), if it tells them itself.
        colour: file of the colour image.
    """

    scale: float = MILLIMETRES
    root: Path | None = None
    matrix: NDArray[np.float64] | None = None
    colour: Path | None = None


def surroundings(path: Path) -> Surroundings:
    """What is known of a depth image `ROOT/depth/NAME.png` from the files in ROOT.

    BOP: `scene_camera.json` has `cam_K` and `depth_scale` (millimetres per unit) of each image.
    TUM: `depth.txt` is there; depth is in 1/5000 m, and `rgb.txt` names the image nearest in time.
    Otherwise, colour lies in `rgb/NAME.png`.

    Raises:
        InputError: a file there is damaged, or does not mention the image.
    """
    root = path.parent.parent
    if path.parent.name != "depth":
        return Surroundings()
    if (root / "scene_camera.json").is_file():
        return _bop(path, root)
    if (root / "depth.txt").is_file():
        return Surroundings(TUM_UNIT, root, colour=_tum_colour(path, root))
    return Surroundings(root=root, colour=_same_name(path, root))


def colour_matrix(root: Path | None, image: Path) -> NDArray[np.float64] | None:
    """Intrinsics (3, 3) of colour from the same place but in other pixels; None if it has none.

    ScanNet's exports have them in `intrinsic/intrinsic_color.txt`, Record3D's in `metadata.json`.

    Raises:
        InputError: a file there is damaged.
    """
    if root is None:
        return None
    if (root / SCANNET_COLOUR).is_file():
        return read_calibration(root / SCANNET_COLOUR).matrix
    calibration = record3d_calibration([root], image)
    return None if calibration is None else calibration.matrix


def _bop(path: Path, root: Path) -> Surroundings:
    file = root / "scene_camera.json"
    try:
        cameras = json.loads(read_text(file))
        camera = cameras[str(int(path.stem))]
        matrix = np.array(camera["cam_K"], np.float64).reshape(3, 3)
        scale = float(camera.get("depth_scale", 1.0)) * MILLIMETRES
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"{file} does not tell the camera of {path.name} ({type(error).__name__}: {error}); "
            "expected cam_K and depth_scale by the image's number"
        ) from error
    if not 0 < scale < math.inf:
        raise InputError(
            f"{file} does not tell the camera of {path.name} (depth_scale is "
            f"{camera['depth_scale']}); expected millimetres per unit, such as 1.0"
        )
    return Surroundings(scale, root, matrix, _same_name(path, root))


def _same_name(path: Path, root: Path) -> Path | None:
    names = (root / folder / (path.stem + suffix) for folder in _COLOURS for suffix in _IMAGES)
    return next((name for name in names if name.is_file()), None)


def _tum_colour(path: Path, root: Path) -> Path | None:
    """The colour image nearest in time, None if there is none within 20 ms."""
    if not (root / "rgb.txt").is_file():
        return None
    depth_times, depths = timed_lines(root / "depth.txt")
    colour_times, colours = timed_lines(root / "rgb.txt")
    numbers = [number for number, words in enumerate(depths) if Path(words[0]).name == path.name]
    if not numbers:
        return None
    nearest = int(nearest_times(depth_times[numbers[:1]], colour_times, _MOST_DELAY)[0])
    return root / colours[nearest][0] if nearest >= 0 else None
