"""Depth images and masks from the body of a request, read as files of the command line are."""

from __future__ import annotations

import io
import json
import re
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image, ImageSequence

from scenefw.core.errors import InputError, SceneFWError
from scenefw.core.files import DAMAGED, unreadable
from scenefw.data.files.arrays import mask_of, read_mask
from scenefw.data.files.camera_pose import camera_pose_of
from scenefw.data.files.pictures import DAMAGED_PICTURE
from scenefw.tasks.depth_images import DepthImages
from scenefw_serving.scored_masks import ids_of_masks, pixels_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Frame
    from scenefw_serving.limits import Limits

_PLAIN_NAME = re.compile(r"[\w-]{1,64}", re.ASCII)
_UNPACKED = 16
"""Times the largest body that an archive may unpack to: flat images compress tenfold."""

FIELDS = {
    "depth": "the depth image: .npz with K, or 16-bit .png or .npy with intrinsics",
    "intrinsics": "of .png and .npy: JSON, YAML or text with fx, fy, cx, cy or a matrix K",
    "colour": "a picture aligned with the depth, optional",
    "mask": "a picture with an id of each pixel's object, 0 = none, optional",
    "masks": "pictures of one object each, 0 = outside, one value inside, optional; several parts, "
    "or keys of the .npz",
    "camera_pose": "of the camera in a robot's base: JSON, YAML or text with a 4 x 4 matrix, or "
    "x y z qx qy qz qw; answers are then in the base; optional",
    "scores": "a JSON list, a number of each of the masks; the highest has the pixel",
}
_SETTING = re.compile(rf"\brun\.({'|'.join([*FIELDS, 'depth_scale'])})\b(=[A-Z]+)?")


def in_fields(line: str) -> str:
    """Advice for the command line with the fields and parameters of requests for its settings."""
    return _SETTING.sub(r"\1", line)


class LimitError(SceneFWError):
    """A request is larger than the service takes."""


@dataclass(frozen=True)
class Part:
    """A part of a request.

    Args:
        data: its content.
        filename: as the client calls it; may be empty.
    """

    data: bytes
    filename: str = ""

    @property
    def suffix(self) -> str:
        """Of its kind, by its first bytes; that of its name where these don't say."""
        for start, suffix in _STARTS.items():
            if self.data.startswith(start):
                return suffix
        suffix = Path(self.filename).suffix.lower()
        return suffix if suffix in _TEXTS else ".json"

    def stem(self, default: str) -> str:
        """Of the client's name if that is plain."""
        stem = Path(self.filename).stem
        return stem if _PLAIN_NAME.fullmatch(stem) else default


_TEXTS = (".json", ".yaml", ".yml", ".txt", ".intr")
_STARTS = {
    b"PK\x03\x04": ".npz",
    b"\x93NUMPY": ".npy",
    b"\x89PNG": ".png",
    b"\xff\xd8\xff": ".jpg",
}


@dataclass(frozen=True)
class Upload:
    """What a client sent.

    Args:
        parts: by field.
        depth_scale: metres per unit of integer depth; None = that of the format.
    """

    parts: Mapping[str, Sequence[Part]] = field(default_factory=dict)
    depth_scale: float | None = None

    def read(self, limits: Limits) -> tuple[Frame, Any, Any]:
        """The frame, its mask (H, W) or None, and the camera's pose (4, 4) in a base or None.

        Raises:
            InputError: the image is unusable, in the words of the command line.
            LimitError: it is larger than the service takes.
            ConfigError: the depth scale is not positive.
        """
        self._require_fields()
        with TemporaryDirectory() as name:
            folder = Path(name)
            try:
                return self._read(folder, limits)
            except InputError as error:
                raise type(error)(str(error).replace(f"{folder}/", "")) from error

    def _require_fields(self) -> None:
        unknown = set(self.parts) - set(FIELDS)
        if unknown:
            fields = ", ".join(FIELDS)
            raise InputError(f"no field {', '.join(sorted(unknown))}; give some of {fields}")
        for name, parts in self.parts.items():
            if name != "masks" and len(parts) > 1:
                raise InputError(f"{len(parts)} parts are called {name}; give one")
        if "depth" not in self.parts:
            raise InputError(f"the request has no depth image; give depth, {FIELDS['depth']}")

    def _read(self, folder: Path, limits: Limits) -> tuple[Frame, Any, Any]:
        depth = self.parts["depth"][0]
        if depth.suffix not in (".npz", ".npy", ".png"):
            raise InputError(f"depth is no .npz, .npy or .png; give {FIELDS['depth']}")
        if depth.suffix != ".npz" and "intrinsics" not in self.parts:
            raise InputError(f"no intrinsics; give intrinsics, {FIELDS['intrinsics']}")
        image = folder / f"{depth.stem('image')}{depth.suffix}"
        _write(image, depth, limits)
        beside = folder / "beside"
        beside.mkdir()
        paths: dict[str, Path | None] = {"intrinsics": None, "mask": None, "camera_pose": None}
        for field_name in tuple(paths):
            for part in self.parts.get(field_name, ()):
                paths[field_name] = beside / f"{field_name}{part.suffix}"
                _write(beside / f"{field_name}{part.suffix}", part, limits)
        for part in self.parts.get("colour", ()):
            _write(image.with_suffix(f".rgb{part.suffix}"), part, limits)
        ids, losses = self._ids(image, limits)
        if ids is not None:
            paths["mask"] = beside / "masks.png"
            Image.fromarray(ids.astype(np.uint16)).save(beside / "masks.png")
        images = DepthImages("serve", image, paths["intrinsics"], self.depth_scale, paths["mask"])
        frame, mask = images.read(image)
        _require_pixels(frame.depth.shape[::-1], image.name, limits)
        if "colour" in self.parts and frame.colour is None:
            raise InputError("; ".join(frame.notes) or f"colour of {image.name} can't be read")
        if ids is not None and mask.dtype == np.bool_:  # a single object keeps its id, too
            mask = mask * ids.max()
        frame = replace(frame, notes=(*frame.notes, *losses))
        return frame, mask, camera_pose_of(paths["camera_pose"])

    def _ids(self, image: Path, limits: Limits) -> tuple[NDArray[np.int32] | None, tuple[str, ...]]:
        """Ids of masks, from parts or from arrays of the .npz, None if there are none; notes."""
        masks, scores = self._masks(image, limits)
        if masks is None:
            if scores is not None:
                raise InputError("there are scores and no masks; give masks, one of each score")
            return None, ()
        if len(masks) > limits.masks:
            raise LimitError(f"{len(masks)} masks in one request; give at most {limits.masks}")
        ids, losses = ids_of_masks(masks, scores)
        mask_of(ids, ids.shape, image.name)
        return ids, losses

    def _require_single(self, keys: Sequence[str], name: str) -> None:
        for field_name, key in {"colour": "rgb", "masks": "masks", "scores": "scores"}.items():
            if field_name in self.parts and key in keys:
                raise InputError(
                    f"{field_name} comes twice, in the request and as {key} in {name}; give one"
                )

    def _masks(self, image: Path, limits: Limits) -> tuple[Any, Any]:
        masks: Any = None
        scores: Any = None
        if image.suffix == ".npz":
            try:
                with np.load(image, allow_pickle=False) as arrays:
                    self._require_single(arrays.files, image.name)
                    masks = arrays["masks"] if "masks" in arrays.files else None
                    scores = arrays["scores"] if "scores" in arrays.files else None
            except DAMAGED as error:
                reason = unreadable(error, "is the file complete?")
                raise InputError(f"cannot read {image}: {reason}") from error
        if "masks" in self.parts:
            folder = image.parent / "masks"
            folder.mkdir()
            parts = enumerate(self.parts["masks"], start=1)
            masks = _stack([_picture(part, folder, str(n), limits) for n, part in parts])
        if "scores" in self.parts:
            scores = _numbers(self.parts["scores"][0])
        return masks, scores


def _write(path: Path, part: Part, limits: Limits) -> None:
    """A part as a file, unless it would unpack to more than the service takes."""
    if part.suffix == ".npz":
        _require_unpacked(part.data, path.name, limits)
    elif part.suffix in (".png", ".jpg"):
        _require_picture(part.data, path.name, limits)
    path.write_bytes(part.data)


def _require_unpacked(data: bytes, name: str, limits: Limits) -> None:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
    except DAMAGED as error:
        reason = unreadable(error, "is the file complete?")
        raise InputError(f"cannot read {name}: {reason}") from error
    if size > _UNPACKED * limits.body_bytes:
        raise LimitError(
            f"{name} unpacks to {size / 1e6:.0f} MB; this service takes "
            f"{_UNPACKED * limits.body:g} MB (run.limits.body)"
        )


def _require_picture(data: bytes, name: str, limits: Limits) -> None:
    try:
        with Image.open(io.BytesIO(data)) as picture:
            _require_pixels(picture.size, name, limits)
    except DAMAGED_PICTURE as error:
        reason = unreadable(error, "is the file complete?")
        raise InputError(f"cannot read {name}: {reason}") from error


def _require_pixels(size: tuple[int, ...], name: str, limits: Limits) -> None:
    if size[0] * size[1] > limits.pixel_count:
        raise LimitError(
            f"{name} has {size[0]} x {size[1]} pixels; this service takes "
            f"{limits.pixels:g} megapixels (run.limits.pixels); make it smaller, K with it"
        )


def _picture(part: Part, folder: Path, default: str, limits: Limits) -> NDArray[np.bool_]:
    """The pixels (H, W) of a mask of one object, which may be empty."""
    path = folder / f"{part.stem(default)}{part.suffix}"
    _require_picture(part.data, path.name, limits)
    try:
        with Image.open(io.BytesIO(part.data)) as picture:
            shape = picture.size[::-1]
            extremes = [frame.getextrema() for frame in ImageSequence.Iterator(picture)]
    except DAMAGED_PICTURE as error:
        reason = unreadable(error, "give a PNG")
        raise InputError(f"cannot read mask {path.name}: {reason}") from error
    if extremes == [(0, 0)]:
        return np.zeros(shape, dtype=np.bool_)
    path.write_bytes(part.data)
    return pixels_of(read_mask(path, shape), f"mask {path.name}")


def _stack(masks: Sequence[NDArray[np.bool_]]) -> NDArray[np.bool_]:
    shapes = sorted({mask.shape for mask in masks})
    if len(shapes) > 1:
        raise InputError(f"masks have shapes {shapes[0]} and {shapes[1]}; give that of the depth")
    return np.stack(masks)


def _numbers(part: Part) -> Any:
    try:
        return np.asarray(json.loads(part.data))
    except (ValueError, RecursionError) as error:
        raise InputError(f"scores are no JSON ({error}); give a list of numbers") from error
