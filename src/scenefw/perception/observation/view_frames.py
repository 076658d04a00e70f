"""The depth images that partial TSDFs were made of, as frames."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenefw.core.errors import InputError
from scenefw.core.types import Frame
from scenefw.kernels.cameras import camera_of

if TYPE_CHECKING:
    from scenefw.core.batches import PartialTSDF


def seen_frames(partial: PartialTSDF, method: str) -> list[Frame]:
    """A frame with its camera for each view.

    Args:
        partial: of B views.
        method: what needs the images, for the message.

    Raises:
        InputError: the partial TSDF came without its depth images.
    """
    if partial.depth is None or partial.cameras is None:
        raise InputError(
            f"{method} needs the depth images of partial TSDFs; their mapping left them out"
        )
    images = partial.depth.cpu().numpy()
    colours = [None] * len(images) if partial.colours is None else partial.colours.cpu().numpy()
    return [
        Frame(depth, camera_of(partial.cameras, i), colour)
        for i, (depth, colour) in enumerate(zip(images, colours, strict=True))
    ]
