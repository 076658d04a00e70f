"""Labels of images of a BOP data set, from its masks of visible pixels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from scenefw.core.errors import LabelsError
from scenefw.core.settings import NOT_NEGATIVE
from scenefw.data.files.pictures import DAMAGED_PICTURE

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from scenefw.core.types import Int32

_FOLDER = "mask_visib"
_WIDTH = 640  # pixels


class VisibleMasks:
    """Labels from `SCENE/mask_visib/NAME_*.png`, beside `SCENE/depth/NAME.png` (Hodan et al. 2018).

    Each file is an object, its mask above 0. Things that a data set doesn't annotate count as no
    object. Pixels of an object of which hardly any are seen count for nothing.

    Args:
        smallest: objects of fewer visible pixels (of an image 640 wide) count for nothing.

    Raises:
        ConfigError: a negative number.
    """

    hint = "expected masks SCENE/mask_visib/NAME_*.png of BOP beside SCENE/depth/NAME.png"

    def __init__(self, smallest: float = 100.0) -> None:
        NOT_NEGATIVE.require(smallest=smallest)
        self.smallest = smallest

    def of(self, image: Path) -> Int32 | None:
        """Labels (H, W): -1 hardly seen, 0 no object, 1..N; None if the image has no masks.

        Raises:
            LabelsError: a mask can't be read, or they are of several sizes.
        """
        files = sorted((image.parent.parent / _FOLDER).glob(f"{image.stem}_*.png"))
        if image.parent.name != "depth" or not files:
            return None
        masks = [_mask(file) for file in files]
        labels: Int32 = np.zeros(masks[0].shape, dtype=np.int32)
        fewest = self.smallest * (labels.shape[1] / _WIDTH) ** 2
        number = 0
        for file, mask in zip(files, masks, strict=True):
            if mask.shape != labels.shape:
                raise LabelsError(f"{file} has another size than {files[0]}; export them again")
            visible = mask.sum() >= max(fewest, 1)
            number += int(visible)
            labels[mask] = number if visible else -1
        return labels


def _mask(file: Path) -> NDArray[np.bool_]:
    try:
        with Image.open(file) as image:
            values = np.asarray(image.convert("L"))
    except DAMAGED_PICTURE as error:
        raise LabelsError(f"cannot read {file} ({error}); download or export it again") from error
    return np.asarray(values > 0)
