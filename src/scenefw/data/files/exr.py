"""Depth from OpenEXR files, as renderers write it."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from scenefw.core.errors import InputError, MissingDependencyError
from scenefw.core.types import Float32

_NAMES = ("z", "depth", "v", "y")  # last parts of names that channels of depth have
_NOTHING = 1e6  # m: what renderers write where a ray hits nothing


def read_exr(path: Path) -> Float32:
    """Depth (H, W) of the channel that is named as depth; 0 where it is 1e6 or more.

    Raises:
        MissingDependencyError: OpenEXR is not installed.
        InputError: the file is damaged, cropped, or has none of these channels.
    """
    try:
        import OpenEXR
    except ImportError as error:
        raise MissingDependencyError(
            f"{path} needs OpenEXR: pip install 'scenefw[exr]', or store the depth as .npy"
        ) from error
    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            windows = [
                np.array(file.header()[name]).tolist() for name in ("dataWindow", "displayWindow")
            ]
            channels = {
                name: np.array(channel.pixels, np.float32)
                for name, channel in file.channels().items()
            }
    except (OSError, RuntimeError, ValueError, TypeError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"cannot read {path}: {reason}; is the file complete?") from error
    if windows[0] != windows[1]:
        raise InputError(
            f"{path} holds the part {windows[0]} (first and last column, row) of an image "
            f"{windows[1]}, to which its intrinsics may belong; write the whole image, or "
            "make both windows the same"
        )
    values = channels[_depth_channel(channels, path)]
    return np.where(values < _NOTHING, values, 0)


def _depth_channel(channels: Mapping[str, Float32], path: Path) -> str:
    """By its name, such as Z or Blender's ViewLayer.Depth.Z; or the single one, or that of grey."""
    for last in _NAMES:
        names = [name for name in channels if name.rpartition(".")[2].lower() == last]
        names.sort(key=lambda name: ("depth" not in name.lower(), len(name)))
        if names:
            return names[0]
    if len(channels) == 1:
        return next(iter(channels))
    red, *others = (channels.get(name) for name in "RGB")
    if red is not None and all(
        other is None or not other.any() or np.array_equal(other, red, equal_nan=True)
        for other in others
    ):
        return "R"
    raise InputError(
        f"{path} has the channels {', '.join(channels) or 'none'}, none of them depth; store depth "
        "as channel Z"
    )
