"""Drawn scenes side by side."""

from collections.abc import Sequence

from scenefw.core.types import SceneEstimate
from scenefw.report.palette import instance_colours
from scenefw.report.pictures import beside
from scenefw.report.shading import Picture, draw, turned
from scenefw.report.solids import solid_of
from scenefw.report.window import cropped, vertices, window

_SIZE = (320, 240)  # of a tile: width, height (pixels)
_TURN = 150.0  # degrees
_COLUMNS = 4


def draw_scenes(scenes: Sequence[SceneEstimate]) -> Picture:
    """RGB (H, W, 3) in [0, 1]: each scene from the front, and below it from behind.

    Args:
        scenes: one or more.
    """
    colours = instance_colours(max(max(int(scene.instances.max()) for scene in scenes), 1))
    tiles: list[Picture] = []
    names: list[str] = []
    for start in range(0, len(scenes), _COLUMNS):
        row = scenes[start : start + _COLUMNS]
        padded = [*row, *[None] * (_COLUMNS - len(row) if len(scenes) > _COLUMNS else 0)]
        for turn in (0.0, _TURN):
            for scene in padded:
                if scene is None:
                    tiles.append(tiles[-1] * 0 + 1)
                    names.append("")
                    continue
                solid = solid_of(scene, colours)
                camera = cropped(scene.frame.camera, *window(scene)).resized(*_SIZE)
                side = turned(camera, vertices(scene), turn) if turn else camera
                tiles.append(draw(solid, side))
                names.append("from behind" if turn else _name(scene))
    return beside(tiles, names, columns=min(_COLUMNS, len(scenes)))


def _name(scene: SceneEstimate) -> str:
    count = len(scene.objects)
    return f"{scene.frame.name}: {count} object{'' if count == 1 else 's'}"
