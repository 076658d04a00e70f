"""A scene before and after it was edited, side by side, and its objects as a table."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from scenefw.report.palette import colours_of
from scenefw.report.pictures import beside
from scenefw.report.shading import draw, turned
from scenefw.report.solids import solid_of
from scenefw.report.tables import Cell, Column, Table
from scenefw.report.window import by_label, cropped, vertices, window
from scenefw_editing.sizes import size, volume

if TYPE_CHECKING:
    from scenefw.core.types import SceneEstimate
    from scenefw.report.shading import Picture

_SIZE = (400, 300)  # of a tile: width, height (pixels)
_TURN = 150.0  # degrees


def draw_edited(before: SceneEstimate, after: SceneEstimate) -> Picture:
    """RGB (H, W, 3) in [0, 1]: both from the camera, and below from behind.

    An object has the colour of its id in both.
    """
    combined_scene = replace(after, objects=(*before.objects, *after.objects))
    camera = cropped(after.frame.camera, *window(combined_scene)).resized(*_SIZE)
    sides = (camera, turned(camera, vertices(combined_scene), _TURN))
    solids = [solid_of(scene, by_label(scene, colours_of(scene))) for scene in (before, after)]
    tiles = [draw(solid, side) for side in sides for solid in solids]
    return beside(tiles, ["before", "after", "from behind", "from behind"], columns=2)


def object_table(scene: SceneEstimate) -> Table:
    """A row for each object: size, volume, centre, shape."""
    columns = [Column("size"), Column("volume (cm³)", digits=0)]
    columns += [Column(f"{axis} (m)", digits=3) for axis in "xyz"] + [Column("shape")]
    rows: list[tuple[str, tuple[Cell, ...]]] = [
        (
            f"object {item.id}",
            (
                size(item),
                1e6 * volume(item.mesh),
                *(float(value) for value in item.pose.position),
                "mesh" if item.placed is None else type(item.placed.shape).__name__.lower(),
            ),
        )
        for item in scene.objects
    ]
    return Table(f"Objects of {scene.frame.name or 'the scene'}", tuple(columns), tuple(rows))
