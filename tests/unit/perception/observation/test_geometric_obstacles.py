"""Walls, containers and tall things against boxes on a table, which are none of them."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.perception.obstacles import OBSTACLES
from tests.unit.perception.synthetic import STACK, Box, camera_at, frame_of

from scenefw.core.errors import ConfigError
from scenefw.perception.observation.geometric_obstacles import GeometricObstacles
from scenefw.perception.observation.points import world_points
from scenefw.perception.observation.surface_mesh import surface_mesh

SMALL = Box((0.25, 0.05, 0.0), (0.35, 0.15, 0.1))


def container(width, depth, height, thick=0.02, x=0.0, y=0.0):
    """Four walls about a floor."""
    w, d = width / 2, depth / 2
    return (
        Box((x - w, y - d, 0.0), (x + w, y - d + thick, height)),
        Box((x - w, y + d - thick, 0.0), (x + w, y + d, height)),
        Box((x - w, y - d, 0.0), (x - w + thick, y + d, height)),
        Box((x + w - thick, y - d, 0.0), (x + w, y + d, height)),
    )


def kinds_of(boxes, eye=(0.0, -1.0, 0.9), size=(320, 240), noise=0.001, roll=0.0):
    """Kind of obstacle that most raised pixels of each box are, "" if none."""
    camera = camera_at(eye=eye, size=size, roll=roll)
    frame = frame_of(camera, boxes, noise=noise)
    frame = replace(frame, camera=camera)
    points = world_points(frame)
    raised, floor = points[..., 2] > 0.015, np.abs(points[..., 2]) < 0.015
    regions = OBSTACLES.find(frame, points, raised, floor)
    assert (np.sum([region.pixels for region in regions], axis=0) <= 1).all()  # they share none
    kinds = []
    for i in range(1, len(boxes) + 1):
        mask = raised & (frame.labels == i)
        shares = {region.kind: region.pixels[mask].mean() for region in regions}
        best = max(shares, key=shares.get, default="")
        kinds.append(best if shares.get(best, 0) > 0.5 else "")
    return kinds


@pytest.mark.parametrize("size", [(320, 240), (640, 480)])
def test_things_are_no_obstacles(size):
    row = tuple(Box((x, 0.2, 0.0), (x + 0.06, 0.3, 0.2)) for x in np.arange(-0.3, 0.3, 0.13))
    assert set(kinds_of((*STACK, SMALL, *row), size=size)) == {""}


@pytest.mark.parametrize("size", [(320, 240), (640, 480)])
@pytest.mark.parametrize("roll", [0.0, np.pi / 2, np.pi])
def test_a_wall_behind_things(size, roll):
    wall = Box((-2.0, 0.5, 0.0), (2.0, 0.6, 1.5))
    assert kinds_of((*STACK, SMALL, wall), size=size, roll=roll) == ["", "", "", "wall"]


def test_something_tall():
    robot = Box((-0.5, 0.1, 0.0), (-0.35, 0.25, 0.8))
    assert kinds_of((*STACK, robot), eye=(0.0, -1.4, 0.9)) == ["", "", "tall structure"]


@pytest.mark.parametrize("height", [0.03, 0.15])
@pytest.mark.parametrize("size", [(320, 240), (640, 480)])
def test_a_container_is_an_obstacle_and_its_contents_are_not(height, size):
    """A tray, and a bin into which a camera looks from higher up."""
    contents = (
        Box((-0.05, -0.05, 0.0), (0.05, 0.05, 0.08)),
        Box((0.1, 0.0, 0.0), (0.16, 0.1, 0.1)),
    )
    walls = container(0.6, 0.42, height)
    found = kinds_of((*contents, *walls), eye=(0.0, -0.45, 1.1), size=size)
    assert found[:2] == ["", ""]
    assert set(found[2:]) <= {"enclosure", "wall"}


TOUCHING = (
    Box((-0.23, -0.05, 0.0), (-0.14, 0.05, 0.1)),
    Box((0.05, 0.11, 0.0), (0.15, 0.19, 0.07)),
)
IN_THE_MIDDLE = (Box((-0.06, -0.05, 0.0), (0.04, 0.03, 0.08)),)


@pytest.mark.parametrize("width", [0.5, 0.36])
@pytest.mark.parametrize("height", [0.1, 0.2])
@pytest.mark.parametrize("size", [(320, 240), (640, 480)])
@pytest.mark.parametrize("roll", [0.0, np.pi / 2])
def test_contents_that_touch_the_walls_are_none_of_them(width, height, size, roll):
    shift = (0.5 - width) / 2
    contents = [Box((TOUCHING[0].lower[0] + shift, *TOUCHING[0].lower[1:]),
                    (TOUCHING[0].upper[0] + shift, *TOUCHING[0].upper[1:])),
                TOUCHING[1], *IN_THE_MIDDLE]  # fmt: skip
    walls = container(width, 0.42, height)
    kinds = kinds_of((*contents, *walls), eye=(0.0, -0.35, 1.1), size=size, roll=roll)
    assert kinds[:3] == ["", "", ""]
    assert set(kinds[3:]) <= {"enclosure", "wall"}


@pytest.mark.parametrize("contents", [(), IN_THE_MIDDLE])
def test_a_small_container_is_a_thing_until_something_is_in_it(contents):
    walls = container(0.3, 0.25, 0.1)
    kinds = kinds_of((*contents, *walls), eye=(0.0, -0.35, 0.9), size=(640, 480))
    assert kinds[: len(contents)] == [""] * len(contents)
    assert set(kinds[len(contents) :]) == ({"enclosure"} if contents else {""})


@pytest.mark.parametrize("roll", [0.0, 0.4, 1.0, 2.0])
@pytest.mark.parametrize("eye", [(0.0, -0.3, 1.0), (0.5, -0.8, 0.6)])
def test_things_side_by_side_are_no_container(eye, roll):
    """A wall of books behind a row of boxes that touches it: faces look at others, but outwards."""
    books = tuple(Box((x, 0.1, 0.0), (x + 0.06, 0.2, 0.25)) for x in np.arange(-0.18, 0.17, 0.07))
    boxes = tuple(Box((x, 0.0, 0.0), (x + 0.1, 0.09, 0.08)) for x in (-0.18, -0.05, 0.08))
    tall = Box((-0.28, -0.1, 0.0), (-0.2, 0.2, 0.22))
    assert set(kinds_of((*books, *boxes, tall), eye=eye, roll=roll)) == {""}


def test_numbers_that_no_obstacle_has():
    with pytest.raises(ConfigError, match="max_size"):
        GeometricObstacles(0.0, 0.4, 0.015, 60)


@pytest.mark.parametrize("size", [(160, 120), (640, 480)])
def test_the_mesh_of_a_surface_has_its_area(size):
    """Of the floor that is seen: its corners' quadrilateral, by the shoelace formula."""
    camera = camera_at(eye=(0.0, -0.6, 0.9), size=size)
    points = world_points(replace(frame_of(camera, ()), camera=camera))
    mesh = surface_mesh(points, np.isfinite(points[..., 0]))
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    stride = max(1, size[0] // 320)
    corners = points[::stride, ::stride][[0, 0, -1, -1], [0, -1, -1, 0], :2]
    x, y = corners.T
    expected = abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)) / 2
    assert area == pytest.approx(expected, rel=1e-3)


def test_a_wall_without_any_floor_ends_none():
    frame = frame_of(camera_at(eye=(0.0, -1.0, 0.3)), [Box((-1, 0.5, 0.0), (1, 0.52, 1.5))])
    points = world_points(replace(frame, camera=camera_at(eye=(0.0, -1.0, 0.3))))
    raised = points[..., 2] > 0.015
    nothing = np.zeros(raised.shape, dtype=bool)
    assert isinstance(OBSTACLES.find(frame, points, raised, nothing), list | tuple)
