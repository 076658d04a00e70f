"""Pictures of a growing map: PNGs as it grows, and an animation (GIF) at the end."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from scenefw.core.files import replacing
from scenefw.core.height_maps import HeightMap
from scenefw.report.labelling.pictures import (
    class_legend,
    colour_picture,
    label_picture,
    resized,
    source_picture,
)
from scenefw.report.pictures import beside, save_picture, stacked


class Growth:
    """Writes `growth/000020.png` ... into a folder, and `growth.gif` of them.

    Args:
        folder: that of the run.
        side: of a map's picture (pixels).
        duration: of a picture in the GIF (ms).
    """

    def __init__(self, folder: Path, side: int = 384, duration: int = 200) -> None:
        self.folder = folder
        self.side = side
        self.duration = duration
        self.pictures: list[Path] = []

    def show(self, height_map: HeightMap, frames: int) -> Path:
        """Writes the picture of a map after this many frames."""
        tiles = {f"{frames} frames": colour_picture(height_map)}
        if height_map.labels is not None:
            tiles["labels"] = label_picture(height_map.labels, len(height_map.classes))
        if height_map.sources is not None:
            tiles["labels come from"] = source_picture(height_map.sources)
        resized_tiles = [resized(tile, self.side) for tile in tiles.values()]
        sheet = beside(resized_tiles, list(tiles), columns=len(tiles))
        path = self.folder / "growth" / f"{frames:06d}.png"
        save_picture(stacked(sheet, class_legend(height_map.classes, sheet.shape[1])), path)
        self.pictures.append(path)
        return path

    def film(self) -> Path | None:
        """Writes the animation; None if there are fewer than two pictures."""
        if len(self.pictures) < 2:
            return None
        path = self.folder / "growth.gif"
        frames = _palette_images(self.pictures)
        with replacing(path) as temporary:
            frames[0].save(
                temporary,
                save_all=True,
                append_images=frames[1:],
                duration=[*[self.duration] * (len(frames) - 1), 8 * self.duration],
                loop=0,
            )
        return path


def _palette_images(paths: Sequence[Path]) -> list[Image.Image]:
    """Images of the files in 256 colours, which is what a GIF holds."""
    images = []
    for path in paths:
        with Image.open(path) as image:
            images.append(Image.fromarray(np.asarray(image.convert("RGB"))).quantize(256))
    return images
