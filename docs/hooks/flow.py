"""Draws docs/flow.svg, the way of the data: `python docs/hooks/flow.py` (a test compares them)."""

from pathlib import Path
from xml.sax.saxutils import escape

WIDTH, HEIGHT, GAP, LEFT, LINE = 150, 64, 32, 16, 16
GREY = "#808890"  # readable on white and on black
FILLS = {"data": "#dce9f5", "step": "#f5ead2", "made": "#dcefdc"}

# Rows of boxes: kind, name, line below. An arrow joins neighbours.
ROWS = [
    ("Training data, made where the network trains", [
        ("data", "Shapes", "superquadrics, meshes"),
        ("step", "Stacks", "physics engine"),
        ("data", "Scene", "parameters alone"),
        ("step", "Volumes, views", "rays, noise, fusion"),
        ("made", "Weights", "run=train"),
    ]),
    ("One depth image (reasoning)", [
        ("data", "Depth image", "run=doctor checks it"),
        ("step", "Floor", "z = 0, the cube"),
        ("data", "Partial TSDF", "seen, free, hidden"),
        ("step", "Reconstructor", "segments, fits, flow"),
        ("made", "SceneEstimate", "objects, hypotheses"),
    ]),
    ("Many views (labelling)", [
        ("data", "RGB-D frames", "with poses"),
        ("step", "Height fusion", "six levels of detail"),
        ("data", "Height map", "1025 x 1025"),
        ("step", "Labels", "of views, map, both"),
        ("made", "Labelled map", "run=label"),
    ]),
    ("What comes of it", [
        ("step", "Evaluation", "beside references"),
        ("data", "Result", "figures, measures"),
        ("made", "Report", "page, tables, cards"),
        ("made", "Exports", "GLB, URDF, MJCF ..."),
    ]),
]  # fmt: skip
JOINS = [((0, 4), (1, 3))]  # boxes below each other that an arrow joins: (row, column)
APART = {(3, 2)}  # boxes without an arrow to the next one


def corner(row, column):
    return LEFT + column * (WIDTH + GAP), 34 + row * (HEIGHT + 48)


def arrow(x1, y1, x2, y2):
    return f'<path d="M{x1} {y1} L{x2} {y2}" stroke="{GREY}" fill="none" marker-end="url(#tip)"/>'


def box(x, y, kind, name, below):
    middle = x + WIDTH // 2
    return [
        f'<rect x="{x}" y="{y}" width="{WIDTH}" height="{HEIGHT}" rx="8" fill="{FILLS[kind]}" '
        f'stroke="{GREY}"/>',
        f'<text x="{middle}" y="{y + 28}" font-weight="bold">{escape(name)}</text>',
        f'<text x="{middle}" y="{y + 47}" font-size="12">{escape(below)}</text>',
    ]


def draw():
    columns = max(len(boxes) for _, boxes in ROWS)
    width, height = corner(len(ROWS), columns)
    width, height = width - GAP + LEFT, height - 40
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
        f'height="{height}" font-family="sans-serif" font-size="15" text-anchor="middle" '
        'fill="#202428">',
        "<title>The way of the data through scenefw</title>",
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" '
        f'markerHeight="8" orient="auto"><path d="M0 0 L8 4 L0 8 z" fill="{GREY}"/></marker>'
        "</defs>",
    ]
    for row, (title, boxes) in enumerate(ROWS):
        x, y = corner(row, 0)
        lines.append(
            f'<text x="{x}" y="{y - 12}" text-anchor="start" fill="{GREY}">{escape(title)}</text>'
        )
        for column, (kind, name, below) in enumerate(boxes):
            x, y = corner(row, column)
            lines += box(x, y, kind, name, below)
            if column + 1 < len(boxes) and (row, column) not in APART:
                middle = y + HEIGHT // 2
                lines.append(arrow(x + WIDTH + 3, middle, x + WIDTH + GAP - 3, middle))
    for start, end in JOINS:
        (x1, y1), (x2, y2) = corner(*start), corner(*end)
        lines.append(arrow(x1 + WIDTH // 2, y1 + HEIGHT + 3, x2 + WIDTH - 20, y2 - 3))
    return "\n".join([*lines, "</svg>"]) + "\n"


if __name__ == "__main__":
    target = Path(__file__).parents[1] / "flow.svg"
    target.write_text(draw(), encoding="utf-8")
    print(target)
