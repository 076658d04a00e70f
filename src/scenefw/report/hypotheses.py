"""Several scenes that fit one image, side by side."""

from collections.abc import Sequence

import numpy as np

from scenefw.core.types import SceneEstimate
from scenefw.report.overview import cropped, vertices, window
from scenefw.report.palette import instance_colours
from scenefw.report.pictures import beside
from scenefw.report.shading import Picture, draw, turned
from scenefw.report.solids import solid_of

_SIZE = (400, 300)  # of a tile: width, height (pixels)
_TURN = 150.0  # degrees


def draw_hypotheses(estimates: Sequence[SceneEstimate]) -> Picture:
    """RGB (H, W, 3) in [0, 1]: a column for each scene, from the camera and from behind.

    Args:
        estimates: of one image; the first one decides what is shown. Objects of the same id have
            the same colour.
    """
    first = estimates[0]
    camera = cropped(first.frame.camera, *window(first)).resized(*_SIZE)
    behind = turned(camera, vertices(first), _TURN)
    colours = instance_colours(max(max(int(e.instances.max()) for e in estimates), 1))
    solids = [solid_of(e, colours) for e in estimates]
    tiles = [draw(solid, side) for side in (camera, behind) for solid in solids]
    names = [_name(i, e) for i, e in enumerate(estimates, start=1)]
    return beside(tiles, [*names, *["from behind"] * len(names)], columns=len(estimates))


def _name(number: int, estimate: SceneEstimate) -> str:
    count = len(np.unique(estimate.instances[estimate.instances > 0]))
    kind = ", most typical" if number == 1 else ""
    return f"hypothesis {number}{kind}: {count} object{'' if count == 1 else 's'}"
