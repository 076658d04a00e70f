"""Labels of images that a person drew as polygons."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from skimage.draw import polygon2mask

from scenefw.core import assets
from scenefw.core.errors import ConfigError, LabelsError
from scenefw.core.files import utf8_text

if TYPE_CHECKING:
    from scenefw.core.types import Int32

_ASSETS = Path(__file__).parent / "assets"
_FOLDER = "outlines"  # of sets that ship, here and in the folders of weights
_IGNORED = "ignore"
_LARGEST = 10_000  # pixels of a side
_ODD = (OSError, ValueError, KeyError, TypeError, AttributeError, ArithmeticError, RecursionError)


class Outlines:
    """Labels of images in files of LabelMe (Wada, https://github.com/wkentaro/labelme).

    Each polygon is an object; those of one `group_id` are one. What comes later in a file lies in
    front of what comes before. Polygons with the label `ignore` count for nothing. The file of
    NAME.npz with the picture NAME.rgb.png is NAME.rgb.json or NAME.json.

    Args:
        folder: the name of a set that ships, or a folder with the files; None = beside each image,
            where only NAME.rgb.json is taken, as NAME.json can hold intrinsics.

    Raises:
        ConfigError: no folder and no set has this name.
    """

    def __init__(self, folder: Path | str | None = None) -> None:
        self.folder = None if folder is None else _resolve_folder(folder)

    @property
    def hint(self) -> str:
        """Where outlines are looked for."""
        if self.folder is None:
            return (
                "expected NAME.rgb.json of LabelMe beside NAME, or evaluation.labels.folder=FOLDER"
            )
        return f"expected NAME.rgb.json or NAME.json of LabelMe in {self.folder}"

    def of(self, image: Path) -> Int32 | None:
        """Labels (H, W) of an image: -1 ignored, 0 no object, 1..N; None if it has no outlines.

        Raises:
            LabelsError: the file can't be read, or holds other shapes than polygons.
        """
        folder = image.parent if self.folder is None else self.folder
        names = [f"{image.stem}.rgb.json"] + ([] if self.folder is None else [f"{image.stem}.json"])
        path = next((folder / name for name in names if (folder / name).is_file()), None)
        return None if path is None else _read(path)


def _resolve_folder(folder: Path | str) -> Path:
    roots = (_ASSETS, *assets.folders())
    sets = {path.name: path for root in roots for path in root.glob(f"{_FOLDER}/*/")}
    if str(folder) in sets:
        return sets[str(folder)]
    if not str(folder) or not Path(folder).is_dir():
        raise ConfigError(
            f"no folder '{folder}' of outlines; give one, or a set that ships ({', '.join(sets)})"
        )
    return Path(folder)


def _read(path: Path) -> Int32:
    try:
        content = json.loads(utf8_text(path))
        size = (int(content["imageHeight"]), int(content["imageWidth"]))
        shapes = [
            (str(shape["label"]), _group(shape), _polygon(shape)) for shape in content["shapes"]
        ]
    except _ODD as error:
        raise LabelsError(
            f"cannot read {path} ({str(error) or type(error).__name__}); expected a file of "
            "LabelMe with polygons: imageHeight, imageWidth, shapes"
        ) from error
    if not all(0 < side <= _LARGEST for side in size):
        raise LabelsError(f"{path} is of an image of {size[1]} x {size[0]} pixels; label it again")
    return _painted(shapes, size)


def _group(shape: dict[str, Any]) -> int | str | None:
    group = shape.get("group_id")
    if not isinstance(group, int | str | None):
        raise TypeError(f"group_id is {group}, no number")
    return group


def _polygon(shape: dict[str, Any]) -> np.ndarray:
    """Corners (P, 2): x, y in pixels."""
    if shape.get("shape_type", "polygon") != "polygon":
        raise ValueError(f"a shape is a {shape['shape_type']}, no polygon")
    corners = np.asarray(shape["points"], dtype=np.float64)
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3:
        raise ValueError("a polygon isn't three corners x, y or more")
    if not (np.abs(corners) <= 2 * _LARGEST).all():
        raise ValueError("a corner lies far outside of the image, or isn't a number")
    return corners


def _painted(
    shapes: list[tuple[str, int | str | None, np.ndarray]], size: tuple[int, int]
) -> Int32:
    labels = np.zeros(size, dtype=np.int32)
    groups: dict[int | str | None, int] = {}
    number = 0
    for name, group, corners in shapes:
        if name == _IGNORED:
            label = -1
        elif group is not None and group in groups:
            label = groups[group]
        else:
            number += 1
            label = groups[group] = number
        labels[polygon2mask(size, corners[:, ::-1])] = label
    return labels
