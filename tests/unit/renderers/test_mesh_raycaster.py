"""Ray-cast views and maps of table-tops against open3d, geometry in the plane and reasoning."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from scenefw.core.errors import ConfigError
from scenefw.core.geometry import look_at
from scenefw.core.height_maps import HeightGrid
from scenefw.core.tabletop import PLAIN, STRIPES, Light, TabletopItem
from scenefw.core.types import Camera
from scenefw.renderers.mesh_raycaster import MeshRaycaster
from scenefw_annotated_views.baking import colour_of_points
from scenefw_tabletops.data.table_scenes import TabletopScenes
from scenefw_tabletops.scenes.tabletop import TabletopGenerator, assemble
from scenefw_tabletops.shapes.tabletop import parts
from scenefw_tabletops.shapes.tabletop.library import ProceduralModels

GENERATOR = TabletopGenerator(ProceduralModels())
SCENE = GENERATOR.generate(0, 0)
GEOMETRY = GENERATOR.geometry(SCENE)
EYE, SIZE = (0.1, -0.15, 0.38), (160, 120)
CAMERA = Camera(T_world_camera=look_at(EYE, (0.05, 0.05, 0.0))).resized(*SIZE)
GRID = HeightGrid(vertices=129)
EASY = {
    "labels": [3200, 290, 1084, 226], "map": [50050, 1908, 7725, 6366],
    "depth": 0.43659922, "heights": 0.005471115, "colour": [111.0067, 100.2462, 105.7638],
}  # fmt: skip


class OneBox:
    """A model source whose only model is a white box of 10 x 10 x 5 cm."""

    classes = ("surface", "box")

    def model(self, label, instance):
        look = parts.Look((0.5, 0.5, 0.5))
        return parts.merge([parts.box((0.1, 0.1, 0.05), (0, 0, 0.025), look)])


def box_scene(**changes):
    scene = dataclasses.replace(
        SCENE,
        items=(TabletopItem(1, 0, 0.0, 0.0, 0.0),),
        surface=(0.5, 0.5, 0.5, PLAIN, 0.01, 0, 0, 0, 0, 0, 0),
        lights=(Light((-1.0, 0.0, 1.0), (0.5, 0.5, 0.5)),),
        ambient=(0.2, 0.2, 0.2),
        classes=OneBox.classes,
    )
    return assemble(dataclasses.replace(scene, **changes), OneBox())


def cast_by_open3d(geometry, camera):
    """z-depth and class ids of open3d, table included."""
    o3d = pytest.importorskip("open3d")
    scene = o3d.t.geometry.RaycastingScene()
    count = len(geometry.corners)
    numbers = np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)
    scene.add_triangles(geometry.corners.reshape(-1, 3), numbers)
    table = np.array([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], dtype=np.float32)
    scene.add_triangles(table, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32))
    v, u = np.mgrid[: camera.height, : camera.width]
    local = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)])
    ahead = np.moveaxis(local, 0, -1) @ camera.T_world_camera[:3, :3].T
    origin = np.broadcast_to(camera.T_world_camera[:3, 3], ahead.shape)
    rays = np.concatenate([origin, ahead], axis=-1).astype(np.float32)
    hits = scene.cast_rays(o3d.core.Tensor(rays))
    face, on_table = hits["primitive_ids"].numpy(), hits["geometry_ids"].numpy() == 1
    item = geometry.item_of[np.where(on_table, 0, face)]
    return hits["t_hit"].numpy(), np.where(on_table, 0, geometry.labels[item])


def test_depth_and_labels_equal_open3d():
    frame = next(MeshRaycaster().frames(GEOMETRY, [CAMERA]))
    depth, labels = cast_by_open3d(GEOMETRY, CAMERA)
    assert set(np.unique(labels)) >= {0, 1, 2} or len(np.unique(labels)) >= 3
    assert (np.abs(frame.depth - depth) < 1e-4).mean() > 0.999
    assert (frame.labels == labels).mean() > 0.999
    assert frame.depth.dtype == np.float32
    assert frame.labels.dtype == np.int32


def highest(geometry, x, y):
    """Height and class id over a point, from barycentric coordinates seen from above, float64."""
    corners = geometry.corners.astype(np.float64)
    sides = (corners[:, 1:] - corners[:, :1])[..., :2]
    determinant = sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]
    upright = np.abs(determinant) < 1e-14
    determinant[upright] = 1
    dx, dy = x - corners[:, 0, 0], y - corners[:, 0, 1]
    u = (dx * sides[:, 1, 1] - dy * sides[:, 1, 0]) / determinant
    v = (dy * sides[:, 0, 0] - dx * sides[:, 0, 1]) / determinant
    z = (1 - u - v) * corners[:, 0, 2] + u * corners[:, 1, 2] + v * corners[:, 2, 2]
    z = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & ~upright, z, 0)
    best = np.argmax(z)
    return (z[best], geometry.labels[geometry.item_of[best]]) if z[best] > 0 else (0, 0)


def test_the_map_holds_the_highest_points():
    found = MeshRaycaster().height_map(GEOMETRY, GRID)
    rows, columns = np.random.default_rng(0).integers(0, GRID.vertices, (2, 300))
    expected = [highest(GEOMETRY, *place) for place in GRID.positions()[rows, columns]]
    heights, labels = np.array(expected).T
    assert (np.abs(found.heights[rows, columns] - heights) < 1e-4).mean() > 0.99
    assert (found.labels[rows, columns] == labels).mean() > 0.99
    assert len(np.unique(labels)) >= 3
    assert found.seen.all()
    assert found.classes == SCENE.classes


def test_views_agree_with_the_map():
    """A pixel's point lies at the map's height unless something hangs over it."""
    grid = HeightGrid(vertices=513)
    found = MeshRaycaster().height_map(GEOMETRY, grid)
    frame = next(MeshRaycaster().frames(GEOMETRY, [CAMERA]))
    v, u = np.mgrid[: SIZE[1], : SIZE[0]]
    local = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones(u.shape)])
    points = np.moveaxis(local * frame.depth, 0, -1) @ CAMERA.T_world_camera[:3, :3].T + EYE
    row, column = np.moveaxis(np.rint(grid.to_vertices(points)).astype(int), -1, 0)
    inside = (np.minimum(row, column) >= 0) & (np.maximum(row, column) < grid.vertices)
    row, column = row[inside], column[inside]
    assert (found.labels[row, column] == frame.labels[inside]).mean() > 0.95
    assert np.median(np.abs(found.heights[row, column] - points[..., 2][inside])) < 5e-4


def test_a_lamp_throws_a_shadow():
    """The lamp stands at 45 degrees: 5 cm of height shade 5 cm of the table beyond."""
    found = MeshRaycaster().height_map(box_scene(), HeightGrid(vertices=1025))
    row = found.colour[512, :, 0].astype(float)
    x = found.grid.positions()[512, :, 0]
    lit, shaded = row[np.abs(x + 0.2) < 0.05].mean(), row[(x > 0.055) & (x < 0.095)].mean()
    assert shaded < 0.75 * lit
    assert row[(x > 0.108) & (x < 0.15)].min() > 1.2 * shaded
    assert found.heights[512][np.abs(x) < 0.049] == pytest.approx(0.05, abs=1e-5)
    expected = (0.5 * 0.2) ** (1 / 2.2) * 255  # in the shadow, the light of the room alone
    assert shaded == pytest.approx(expected, abs=1.5)


def test_lights_change_the_colour_alone():
    bright = box_scene(ambient=(0.6, 0.6, 0.6))
    first, second = (next(MeshRaycaster().frames(g, [CAMERA])) for g in (box_scene(), bright))
    assert np.array_equal(first.depth, second.depth)
    assert np.array_equal(first.labels, second.labels)
    assert second.colour.mean() > first.colour.mean() + 10


def test_textures_move_with_their_object():
    """Patterns look the same wherever the model lies; a lamp overhead stays out of it."""
    item = SCENE.items[0]
    lamp = (Light((0.0, 0.0, 50.0), (0.0, 0.0, 0.0)),)
    grid = HeightGrid(vertices=1025)
    images = []
    for x, y in ((-0.1, 0.05), (0.1, -0.05)):
        placed = dataclasses.replace(item, x=x, y=y, yaw=0.3)
        scene = dataclasses.replace(SCENE, items=(placed,), lights=lamp, ambient=(0.9, 0.9, 0.9))
        images.append(MeshRaycaster().height_map(GENERATOR.geometry(scene), grid))
    first, second = images
    moved = np.roll(second.labels, (-100, -200), axis=(0, 1))  # y down by 10 cm, x right by 20
    both = (first.labels > 0) & (moved > 0)
    assert both.sum() > 0.98 * (first.labels > 0).sum()
    colour = np.roll(second.colour, (-100, -200), axis=(0, 1))
    away = np.abs(first.colour.astype(int) - colour)[both].max(axis=-1)
    assert (away <= 4).mean() > 0.97


def test_softened_edges_leave_depth_and_labels():
    plain, soft = (next(MeshRaycaster(c).frames(GEOMETRY, [CAMERA])) for c in (1.0, 0.1))
    assert np.array_equal(plain.depth, soft.depth)
    assert np.array_equal(plain.labels, soft.labels)
    changed = (plain.colour != soft.colour).any(axis=-1).mean()
    assert 0.005 < changed < 0.5


def test_an_empty_table_and_the_horizon():
    empty = GENERATOR.geometry(dataclasses.replace(SCENE, items=()))
    level = CAMERA.moved(look_at((0, 0, 0.3), (1.0, 0, 0.3)))
    frame = next(MeshRaycaster().frames(empty, [level]))
    assert (frame.depth[:60] == 0).all()
    assert (frame.labels[:60] == -1).all()
    assert (frame.depth[60:] > 0).all()
    assert MeshRaycaster().height_map(empty, GRID).heights.max() < 1e-6


def test_one_scene_after_another():
    renderer, other = MeshRaycaster(), GENERATOR.geometry(GENERATOR.generate(1, 0))
    before = next(renderer.frames(GEOMETRY, [CAMERA]))
    next(renderer.frames(other, [CAMERA]))
    after = next(renderer.frames(GEOMETRY, [CAMERA]))
    assert np.array_equal(before.colour, after.colour)


def test_settings():
    with pytest.raises(ConfigError, match="contrast = -1"):
        MeshRaycaster(-1)
    assert MeshRaycaster(0.1).fingerprint() != MeshRaycaster(0.2).fingerprint()


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")
def test_cuda_equals_cpu():
    ours, theirs = (next(MeshRaycaster(device=d).frames(GEOMETRY, [CAMERA]))
                    for d in ("cpu", "cuda"))  # fmt: skip
    assert (np.abs(ours.depth - theirs.depth) > 1e-4).mean() < 0.001
    assert (ours.labels != theirs.labels).mean() < 0.001
    assert (np.abs(ours.colour.astype(int) - theirs.colour).max(axis=-1) > 3).mean() < 0.01


def test_easy_tables_look_as_ever():
    """What weights of easy tables were trained on: figures of its first view, from 1.0.0 on."""
    source = TabletopScenes(GENERATOR, MeshRaycaster(), "validation", size=(80, 60), vertices=257)
    frame, truth = next(source.frames(0, 1)), source.truth(0)
    assert np.bincount(frame.labels.ravel(), minlength=4).tolist() == EASY["labels"]
    assert np.bincount(truth.labels.ravel(), minlength=4).tolist() == EASY["map"]
    assert frame.depth.mean() == pytest.approx(EASY["depth"], abs=1e-6)
    assert truth.heights.mean() == pytest.approx(EASY["heights"], abs=1e-7)
    assert frame.colour.mean(axis=(0, 1)) == pytest.approx(EASY["colour"], abs=2e-3)


def test_textures_turn_with_what_lies_askew():
    """A striped box stood on its side shows the pattern where its own points are."""
    look = parts.Look((0, 0, 0), STRIPES, 0.02, 1.0, 0.4, (1, 1, 1))
    model = parts.merge([parts.box((0.1, 0.08, 0.05), (0, 0, 0.025), look)])
    flat = TabletopItem(1, 0, 0.0, 0.0, 0.0)
    askew = TabletopItem(1, 0, 0.1, -0.05, 0.7, 1.0, 0.02, (0.8, 0.4, -0.3, 0.33))
    colours = []
    for item in (flat, askew):
        scene = dataclasses.replace(SCENE, items=(item,), classes=OneBox.classes)
        geometry = assemble(scene, SimpleNamespace(model=lambda *_: model))
        face = np.arange(len(geometry.corners), dtype=np.int32)
        middles = geometry.corners.mean(axis=1) * 0.4 + geometry.corners[:, 0] * 0.6
        colours.append(colour_of_points(geometry, middles.astype(np.float32), face))
    assert np.ptp(colours[0]) > 0.5
    np.testing.assert_allclose(colours[0], colours[1], atol=2e-2)
