from dataclasses import replace

import numpy as np
import pytest
from tests.unit.tasks.recordings import table

from scenefw.core.height_maps import HeightGrid
from scenefw.report.palette import class_colours
from scenefw_viewer.map_surface import looks, reduced, surface


@pytest.mark.parametrize(("largest", "side"), [(1000, 129), (70, 65), (40, 33), (1, 2)])
def test_a_reduced_map_has_the_same_points(largest, side):
    full, small = table(), reduced(table(), largest)
    assert small.grid.vertices == side
    step = 128 // (side - 1)
    np.testing.assert_allclose(small.grid.positions(), full.grid.positions()[::step, ::step])
    np.testing.assert_array_equal(small.labels, full.labels[::step, ::step])
    np.testing.assert_array_equal(small.heights, full.heights[::step, ::step])


def test_vertices_lie_at_their_heights_and_faces_look_up():
    made = surface(table(), "labels")
    assert len(made.faces) == 2 * 128**2
    assert (made.face_normals[:, 2] > 0).all()
    rows, columns = np.rint(table().grid.to_vertices(made.vertices)).astype(int).T
    np.testing.assert_allclose(made.vertices[:, 2], table().heights[rows, columns], atol=1e-6)


def test_the_picture_lies_where_its_vertices_are():
    """As a renderer of glTF samples it: v is up in trimesh."""
    known = table()
    made = surface(known, "labels")
    texture = np.asarray(made.visual.material.baseColorTexture) / 255
    height, width = texture.shape[:2]
    u, v = made.visual.uv.T
    sampled = texture[
        np.rint((1 - v) * (height - 1)).astype(int), np.rint(u * (width - 1)).astype(int)
    ]
    rows, columns = np.rint(known.grid.to_vertices(made.vertices)).astype(int).T
    expected = np.array(class_colours(4))[known.labels[rows, columns]]
    np.testing.assert_allclose(sampled, expected, atol=0.01)


def test_what_was_not_seen_is_a_hole():
    heights = table().heights.copy()
    heights[40:60, 20:50] = np.nan
    made = surface(replace(table(), heights=heights), "height")
    inner = HeightGrid(129).positions()[50, 35]
    inside = np.abs(made.triangles_center[:, :2] - inner).max(axis=1) < 0.05
    assert not inside.any()
    assert len(made.faces) == 2 * (128**2 - 21 * 31)
    empty = surface(replace(table(), heights=np.full_like(heights, np.nan)), "colour")
    assert len(empty.faces) == 0


def test_looks_are_those_of_what_the_map_has():
    assert looks(table()) == ["labels", "colour", "height"]
    assert looks(replace(table(), labels=None)) == ["colour", "height"]
    sources = np.ones(table().grid.shape, np.uint8)
    assert "labels come from" in looks(replace(table(), sources=sources))
