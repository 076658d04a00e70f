"""Masks of objects as a picture."""

from pathlib import Path

import numpy as np
from PIL import Image

from scenefw.core.files import replacing
from scenefw.core.types import Int32


def write_masks(path: Path, masks: Int32) -> None:
    """Writes ids of objects (H, W), 0 = none, as a PNG of 16 bits."""
    with replacing(path) as temporary:
        Image.fromarray(masks.astype(np.uint16)).save(temporary)
