"""Several scenes that fit one image, side by side."""

from collections.abc import Sequence

import numpy as np

from scenefw.core.types import SceneEstimate
from scenefw.report.pictures import beside, smaller
from scenefw.report.shading import Picture, Solid, draw, turned
from scenefw.report.window import BEHIND, cropped, vertices, window

_SIZE = (400, 300)  # of a tile: width, height (pixels)


def draw_hypotheses(
    estimates: Sequence[SceneEstimate], solids: Sequence[Solid], views: tuple[Picture, Picture]
) -> Picture:
    """RGB (H, W, 3) in [0, 1]: a column for each scene, from the camera and from behind.

    Args:
        estimates: of one image; the first one decides what is shown.
        solids: of them, see `solids.solids_of`.
        views: of the first one, see `window.two_views`.
    """
    first = estimates[0]
    camera = cropped(first.frame.camera, *window(first)).resized(*_SIZE)
    behind = turned(camera, vertices(first), BEHIND)
    tiles = []
    for view, side in zip(views, (camera, behind), strict=True):
        tiles += [smaller(view, _SIZE), *[draw(solid, side) for solid in solids[1:]]]
    names = [_name(i, e) for i, e in enumerate(estimates, start=1)]
    return beside(tiles, [*names, *["from behind"] * len(names)], columns=len(estimates))


def _name(number: int, estimate: SceneEstimate) -> str:
    count = len(np.unique(estimate.instances[estimate.instances > 0]))
    kind = ", most typical" if number == 1 else ""
    return f"hypothesis {number}{kind}: {count} object{'' if count == 1 else 's'}"
