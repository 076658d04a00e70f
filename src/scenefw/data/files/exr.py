"""Depth from OpenEXR files, as renderers write it."""

from pathlib import Path

import numpy as np

from scenefw.core.errors import InputError, MissingDependencyError
from scenefw.core.types import Float32

_CHANNELS = ("Z", "depth", "Depth", "V", "Y", "R")
_NOTHING = 1e6  # m: what renderers write where a ray hits nothing


def read_exr(path: Path) -> Float32:
    """Depth (H, W) of the channel Z, or the first that may hold it; 0 where it is 1e6 or more.

    Raises:
        MissingDependencyError: OpenEXR is not installed.
        InputError: the file is damaged or has none of these channels.
    """
    try:
        import OpenEXR
    except ImportError as error:
        raise MissingDependencyError(
            f"{path} needs OpenEXR: pip install 'scenefw[exr]', or store the depth as .npy"
        ) from error
    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = {
                name: np.array(channel.pixels, np.float32)
                for name, channel in file.channels().items()
            }
    except (OSError, RuntimeError, ValueError, TypeError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"cannot read {path}: {reason}; is the file complete?") from error
    name = next((key for key in (*_CHANNELS, *channels) if key in channels), None)
    if name is None:
        raise InputError(f"{path} has no channel; store depth as channel Z")
    return np.where(channels[name] < _NOTHING, channels[name], 0)
