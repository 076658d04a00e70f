"""Views of surfaces over a table whose depth is known, in numpy and float64."""

import numpy as np
from tests.unit.kernels import analytic

from scenefw.core.geometry import look_at
from scenefw.core.height_maps import HeightGrid
from scenefw.core.types import Camera, Frame

SMALL = HeightGrid(vertices=33, extent=0.128, lower=(-0.064, -0.064), levels=1)
LEVELS = HeightGrid(vertices=65, extent=0.256, lower=(-0.128, -0.128), levels=3)
BOXES = (
    analytic.Box((-0.02, 0.03, 0.01), (0.03, 0.02, 0.01)),
    analytic.Box((0.04, -0.03, 0.015), (0.02, 0.025, 0.015)),
)


def camera(x=0.0, y=0.0, height=0.3, angle=0.0, towards=0.0, width=80, rows=60):
    """A camera above (x, y), its axis at `angle` degrees from straight down."""
    aside = height * np.tan(np.radians(angle))
    target = (x + aside * np.cos(towards), y + aside * np.sin(towards), 0.0)
    return Camera(T_world_camera=look_at((x, y, height), target)).resized(width, rows)


def views(count, seed=0, **options):
    """Random cameras over the middle of the table."""
    rng = np.random.default_rng(seed)
    return [
        camera(
            *rng.uniform(-0.03, 0.03, 2), rng.uniform(0.18, 0.3), rng.uniform(0, 40),
            rng.uniform(0, 2 * np.pi), **options,
        )
        for _ in range(count)
    ]  # fmt: skip


def plane(view, a=0.0, b=0.0, c=0.0, colour=None):
    """The surface z = a x + b y + c."""
    rays, eye = analytic.pixel_rays(view)
    z = (a * eye[0] + b * eye[1] + c - eye[2]) / (
        rays[..., 2] - a * rays[..., 0] - b * rays[..., 1]
    )
    return Frame(np.where(z > 0, z, 0).astype(np.float32), view, colour)


def boxes(view, shapes=BOXES):
    return Frame(analytic.depth(shapes, view).numpy(), view)


def box_heights(grid, shapes=BOXES):
    """True heights (V, V), and whether a vertex is farther than two spacings from every wall."""
    positions = grid.positions()
    heights, clear = np.zeros(grid.shape), np.ones(grid.shape, bool)
    for shape in shapes:
        far = (np.abs(positions - shape.centre[:2]) - shape.half[:2]).max(-1)
        heights[far < 0] = shape.centre[2] + shape.half[2]
        clear &= np.abs(far) > 2 * grid.spacing
    return heights, clear


def points(frame):
    """World points (N, 3) of a frame's pixels."""
    rays, eye = analytic.pixel_rays(frame.camera)
    return (eye + frame.depth[..., None] * rays)[frame.depth > 0]


def triangle(grid, xy):
    """Vertices (3,) and barycentric weights (3,) of a point: plain Python."""
    row, column = grid.to_vertices(xy)
    n = grid.vertices
    if not (0 <= row <= n - 1 and 0 <= column <= n - 1):
        return None
    r, c = min(int(row), n - 2), min(int(column), n - 2)
    f, g = row - r, column - c
    corners = np.array([[0, 0], [0, 1], [1, 1]] if g >= f else [[0, 0], [1, 0], [1, 1]])
    weights = np.linalg.solve(np.vstack([corners.T, np.ones(3)]), [f, g, 1])
    return (r + corners[:, 0]) * n + c + corners[:, 1], weights
