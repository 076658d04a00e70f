"""Frames from files: .npz, or a depth image (.png, .npy) with an intrinsics file beside it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from scenefw.core.errors import InputError
from scenefw.core.files import DAMAGED, in_order, unreadable
from scenefw.core.types import Frame
from scenefw.data.files.exr import read_exr
from scenefw.data.files.frame_assembly import Content, assembled
from scenefw.data.files.image_checks import metres, unused_scale
from scenefw.data.files.intrinsics import (
    Calibration,
    Intrinsics,
    calibration_of,
    intrinsics_file,
    read_calibration,
)
from scenefw.data.files.layouts import MILLIMETRES, Surroundings, surroundings
from scenefw.data.files.pictures import DAMAGED_PICTURE
from scenefw.data.files.record3d import record3d_calibration

Array = NDArray[Any]

_SUFFIXES = (".npz", ".npy", ".png", ".exr")
_BAGS = (".bag", ".db3", ".mcap")  # plugin recordings reads these
_COLOUR_SUFFIXES = (".rgb.jpg", ".rgb.png", ".rgb.jpeg", "_rgb.png", "_rgb.jpg", ".jpg", ".jpeg")
_COLOUR_WORDS = ("rgb", "color", "colour")
_COMPLETE = "is the file complete?"
_MAX_DETAIL = 16  # numbers of an array that may say something of the camera: a 4 x 4 matrix


def read_frames(
    path: Path | str, *, intrinsics: Intrinsics | None = None, depth_scale: float | None = None
) -> list[Frame]:
    """All frames at a path: one image, or those of a folder by name, 2 before 10.

    Raises:
        InputError: as `find_images` and `read_frame`.
    """
    return [
        read_frame(image, intrinsics=intrinsics, depth_scale=depth_scale)
        for image in find_images(path)
    ]


def find_images(path: Path | str) -> list[Path]:
    """Depth images at a path: the file itself, or the .npz, .npy and 16-bit .png of a folder.

    A folder without any is searched with its subfolders.

    Raises:
        InputError: nothing is there, or a folder holds no depth image.
    """
    path = Path(path)
    if not path.exists():
        raise InputError(f"no file or folder {path}; give input=PATH of a depth image or a folder")
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise InputError(f"{path} is neither a file nor a folder; give a depth image or a folder")
    images = [entry for entry in in_order(path.iterdir()) if _is_depth_image(entry)]
    images = images or [entry for entry in in_order(path.rglob("*")) if _is_depth_image(entry)]
    if not images:
        if any(entry.suffix.lower() in _BAGS for entry in path.iterdir()):
            raise InputError(
                f"{path} is a recording; run=unpack_bag input={path} makes images of it"
            )
        raise InputError(
            f"no depth image in {path}; expected .npz, .npy, .exr or 16-bit .png files"
        )
    return images


def read_frame(
    path: Path | str,
    *,
    intrinsics: Intrinsics | None = None,
    depth_scale: float | None = None,
    around: Surroundings | None = None,
) -> Frame:
    """One frame; its camera stands at the origin until a floor is found.

    .npz: `depth_mm` (millimetres) or `depth` (metres), (H, W); `K` (3, 3); optionally `rgb`
    (H, W, 3) uint8 and labels: `instances` (-1 unknown, 0 none, 1..N) or `label` as the Object
    Segmentation Database codes it (see `decode_labels`). .png: 16-bit, metres = value times
    `depth_scale`. .npy: floating point in metres, integers as .png. .exr: metres. The colour image
    lies beside, as NAME.rgb.jpg, or where `surroundings` finds it in a BOP scene, a TUM sequence or
    an RGB-D folder.

    Args:
        path: a .npz, .png or .npy file.
        intrinsics: of .png and .npy, a file or what else `calibration_of` takes; None looks
            beside for NAME.json, intrinsics.json ...
        depth_scale: metres per unit of integer depth; None = that of the format, else millimetres.
            An error where it would change nothing, as depth is in floats or `depth_mm`.
        around: what is known from the recording that the image is of; None looks there.

    Raises:
        InputError: a missing, damaged or unusable file; the message says how to fix it.
        ConfigError: a depth scale that is not positive.
    """
    path = Path(path)
    if not path.is_file():
        if path.is_dir():
            raise InputError(f"{path} is a folder; give one of its depth images")
        raise InputError(f"no file {path}; give input=PATH of a depth image or a folder")
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        if path.suffix.lower() in _BAGS:
            raise InputError(
                f"{path} is a recording; run=unpack_bag input={path} makes images of it"
            )
        suffixes = ", ".join(_READERS)
        raise InputError(f"unknown format '{path.suffix}' of {path}; expected one of {suffixes}")
    try:
        around = surroundings(path) if around is None else around
        content = reader(path, intrinsics, depth_scale, around)
        content = _with_picture(content, _colour_file(path) or around.colour)
        return assembled(content, depth_scale, path.name, path.stem)
    except DAMAGED_PICTURE as error:
        raise InputError(f"cannot read {path}: {unreadable(error, _COMPLETE)}") from error


def read_labels(path: Path | str) -> NDArray[np.int32] | None:
    """The labels (H, W) of an image alone, as `read_frame` has them; None if it has none.

    Raises:
        InputError: the file is damaged.
    """
    path = Path(path)
    if path.suffix.lower() != ".npz":
        return None
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {k: file[k] for k in ("instances", "label") if k in file.files}
            return _npz_labels(arrays, path)
    except DAMAGED as error:
        raise InputError(f"cannot read {path}: {unreadable(error, _COMPLETE)}") from error


def decode_labels(coded: Array) -> NDArray[np.int32]:
    """Instance ids of labels (H, W) coded as in the Object Segmentation Database.

    0 is invalid (-> -1), 1 to 9 the table (-> 0), from 10 on object `value // 10` with its parts in
    the last digit; the objects are renumbered 1..N in the order of their codes.
    """
    labels = np.zeros(coded.shape, dtype=np.int32)
    labels[coded == 0] = -1
    is_object = coded >= 10
    _, order = np.unique(coded[is_object] // 10, return_inverse=True)
    labels[is_object] = order + 1
    return labels


def _read_npz(
    path: Path, intrinsics: Intrinsics | None, depth_scale: float | None, _: Surroundings
) -> Content:
    with np.load(path, allow_pickle=False) as file:
        content = {key: file[key] for key in file.files}
    depth, unit = _npz_depth(content, path, depth_scale)
    if "K" not in content and intrinsics is None:
        raise InputError(
            f"{path} has no intrinsics K (3, 3); store them in it or give run.intrinsics=PATH"
        )
    details = {key: value.tolist() for key, value in content.items() if _is_detail(key, value)}
    calibration = calibration_of(details if intrinsics is None else intrinsics, path.name)
    labels, in_millimetres = _npz_labels(content, path), "depth_mm" in content
    image = Content(depth, calibration, unit, labels=labels, in_millimetres=in_millimetres)
    return _with_colour(image, content["rgb"], "rgb") if "rgb" in content else image


def _is_detail(key: str, value: Array) -> bool:
    """Whether an array may say something of the camera, as an entry of an intrinsics file does."""
    return key not in ("depth", "depth_mm", "rgb", "instances", "label", "size") and (
        value.ndim <= 2 and value.size <= _MAX_DETAIL
    )


def _npz_depth(
    content: dict[str, Array], path: Path, depth_scale: float | None
) -> tuple[Array, float]:
    """Depth (H, W), and metres per unit if it is in whole numbers."""
    if "depth_mm" in content:
        if depth_scale is not None:
            raise unused_scale(depth_scale, path.name, "depth_mm is in millimetres")
        depth = metres(content["depth_mm"], None, path.name, unit=1.0) / np.float32(1000)
        if "depth" in content and not _agree(content["depth"], depth):
            raise InputError(f"depth_mm and depth of {path} differ; keep one of them")
        return depth, 1.0
    if "depth" in content:
        return content["depth"], 1.0
    keys = ", ".join(content) or "nothing"
    raise InputError(
        f"{path} holds {keys}, no depth; store depth_mm (millimetres) or depth (metres)"
    )


def _agree(depth: Array, other: Array) -> bool:
    """Whether depth in metres or in millimetres is another one (m), to a millimetre."""
    return depth.dtype.kind in "uif" and any(
        depth.shape == other.shape and np.allclose(unit * depth, other, atol=MILLIMETRES, rtol=0)
        for unit in (1.0, MILLIMETRES)
    )


def _npz_labels(content: dict[str, Array], path: Path) -> Array | None:
    key = next((key for key in ("instances", "label") if key in content), None)
    if key is None:
        return None
    labels = content[key]
    if labels.dtype.kind not in "uib" and not _holds_integers(labels):
        raise InputError(
            f"{key} of {path} is of {labels.dtype}; give whole numbers, or leave it out"
        )
    return labels.astype(np.int32) if key == "instances" else decode_labels(labels)


def _holds_integers(values: Array) -> bool:
    """Whether floats are whole numbers."""
    return values.dtype.kind == "f" and bool((values == np.round(values)).all())


def _read_png(
    path: Path, intrinsics: Intrinsics | None, depth_scale: float | None, around: Surroundings
) -> Content:
    with Image.open(path) as image:
        if not image.mode.startswith("I"):
            raise InputError(
                f"{path} is a picture of mode {image.mode}; a depth image has one 16-bit channel"
            )
        values = np.array(image)
    return Content(values, _calibration(path, intrinsics, values, around), around.scale)


def _read_npy(
    path: Path, intrinsics: Intrinsics | None, depth_scale: float | None, around: Surroundings
) -> Content:
    values = np.load(path, allow_pickle=False)
    if values.ndim < 2:
        raise InputError(f"{path} has shape {values.shape}; expected an image (H, W)")
    return Content(values, _calibration(path, intrinsics, values, around), around.scale)


def _read_exr(
    path: Path, intrinsics: Intrinsics | None, depth_scale: float | None, around: Surroundings
) -> Content:
    values = read_exr(path)
    return Content(values, _calibration(path, intrinsics, values, around))


_READERS: dict[str, Callable[[Path, Intrinsics | None, float | None, Surroundings], Content]] = {
    ".npz": _read_npz,
    ".png": _read_png,
    ".npy": _read_npy,
    ".exr": _read_exr,
}


def _calibration(
    path: Path, intrinsics: Intrinsics | None, values: Array, around: Surroundings
) -> Calibration:
    """What is given or lies beside, of the image's size where its format says how it is scaled."""
    if intrinsics is not None:
        return calibration_of(intrinsics, path.name)
    if around.matrix is not None:
        return Calibration(around.matrix)
    file = _beside(path, around)
    if file is not None:
        return read_calibration(file)
    camera = record3d_calibration(_folders(path, around), path)
    if camera is not None:
        return camera.resized(*values.shape[1::-1])
    raise InputError(
        f"no intrinsics for {path}; put {path.stem}.json or intrinsics.json with fx, fy, cx, cy "
        "beside it, or give run.intrinsics=PATH"
    )


def _folders(path: Path, around: Surroundings) -> list[Path]:
    return [folder for folder in (path.parent, around.root) if folder is not None]


def _beside(path: Path, around: Surroundings) -> Path | None:
    """The file with intrinsics beside an image."""
    return intrinsics_file(_folders(path, around), (path.stem, f"{path.stem}.intrinsics"))


def _colour_file(path: Path) -> Path | None:
    """The colour image beside a depth image, None if there is none."""
    names = [path.stem + suffix for suffix in _COLOUR_SUFFIXES]
    if "depth" in path.stem:
        names += [
            path.stem.replace("depth", word) + suffix
            for word in _COLOUR_WORDS
            for suffix in (".png", ".jpg", ".jpeg")
        ]
    paths = (path.with_name(name) for name in names if path.with_name(name).is_file())
    return next(paths, None)


def _with_picture(content: Content, path: Path | None) -> Content:
    """With the colours of a picture, if it has the size of the depth."""
    if path is None or content.colour is not None:
        return content
    try:
        with Image.open(path) as image:
            colour = np.array(image.convert("RGB"))
    except DAMAGED_PICTURE as error:
        raise InputError(
            f"cannot read the colour image {path}: {unreadable(error, _COMPLETE)}"
        ) from error
    return _with_colour(content, colour, path.name)


def _with_colour(content: Content, colour: Array, name: str) -> Content:
    """With colours (H, W, 3 or 4), or a note that they are of another size than the depth."""
    shape = content.depth.shape[:2]
    if colour.ndim != 3 or len(shape) != 2 or colour.shape[:2] == shape:  # or refused later
        has_alpha = colour.ndim == 3 and colour.shape[2] == 4
        return replace(content, colour=colour[..., :3].copy() if has_alpha else colour)
    note = (
        f"colour {name} is left out: it has {colour.shape[1]} x {colour.shape[0]} pixels, "
        f"depth {shape[1]} x {shape[0]}; align it to depth with your camera's software"
    )
    return replace(content, notes=(*content.notes, note))


def _is_depth_image(path: Path) -> bool:
    suffix = path.suffix.lower()
    if suffix not in _SUFFIXES or not path.is_file():
        return False
    if suffix != ".png":
        return True
    try:
        with Image.open(path) as image:
            return image.mode.startswith("I")
    except DAMAGED_PICTURE:
        return False
