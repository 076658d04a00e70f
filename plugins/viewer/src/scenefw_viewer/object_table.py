"""The table of a scene's objects in the viewer."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

from scenefw.report.palette import instance_colours
from scenefw_editing import sizes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.perception.physics.support_graph import SupportGraph
    from scenefw_viewer.edits import Edits

_HEADER = (
    "<tr style='text-align:left;opacity:0.6'><td></td><td></td><td>size</td><td>volume</td>"
    "<td>agreement</td><td>stands on</td></tr>"
)


def object_table(edits: Edits, supports: SupportGraph, warnings: Sequence[str]) -> str:
    """A line of HTML per object: colour, number, size, volume, confidence, what it stands on.

    Below is the order in which to take them away, and what looks odd about the image.

    Args:
        edits: the scene.
        supports: of its objects.
        warnings: one line each.
    """
    rows = "".join(_row(edits, label, supports) for label in edits.ids)
    order = " → ".join(map(str, supports.removal_order()))
    advice = f"<p>take away {order}</p>" if len(supports.heights) > 1 else ""
    notices = "".join(f"<p style='color:#a15c00'>{html.escape(line)}</p>" for line in warnings)
    table = f"<table style='width:100%;border-spacing:0 2px'>{_HEADER}{rows}</table>"
    style = "font-size:0.85em;padding:0 0.8em;line-height:1.45"
    return f"<div style='{style}'>{table if rows else 'no object'}{advice}{notices}</div>"


def _row(edits: Edits, label: int, supports: SupportGraph) -> str:
    item, is_removed = edits.item(label), label in edits.removed
    red, green, blue = (round(255 * part) for part in instance_colours(label)[-1])
    square = f"<td style='color:rgb({red},{green},{blue})'>&#9632;</td>"
    cells = (
        str(label),
        sizes.size(item),
        f"{1000 * sizes.volume(item.mesh):.2f} l",
        "removed" if is_removed else f"{item.confidence:.0%}",
        supports.support_of(label),
    )
    style = " style='opacity:0.45'" if is_removed else ""
    return f"<tr{style}>{square}" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"
