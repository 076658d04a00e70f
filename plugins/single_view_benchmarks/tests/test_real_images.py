"""Groups of images: boxes whose masks, places and sizes are known."""

import json
from dataclasses import replace

import numpy as np
import pytest
from tests.unit.perception.synthetic import STACK, Box, camera_at, frame_of

from scenefw.core.errors import ConfigError, InputError, LabelsError
from scenefw.core.types import GridSpec, Obstacle, SceneEstimate, TriangleMesh
from scenefw.perception.estimate.objects import estimate_objects
from scenefw.report.presentation import Chapter
from scenefw.shapes.hulls import hull_mesh
from scenefw_single_view_benchmarks.outlines import Outlines
from scenefw_single_view_benchmarks.real_images import RealImages, odd_objects
from scenefw_single_view_benchmarks.stored_labels import StoredLabels

CAMERA = camera_at(eye=(0.0, -1.2, 0.8), size=(320, 240))
BOXES = (STACK[0], Box((0.16, -0.2, 0.0), (0.23, -0.06, 0.08)))
FRAME = frame_of(CAMERA, BOXES)
LABELS = {"stored": StoredLabels()}
OBSTACLE = Obstacle("wall", TriangleMesh(np.zeros((3, 3)), np.zeros((1, 3), np.int64)))


def mesh_of(box, raised=0.0, scale=1.0):
    low, high = np.array(box.lower), np.array(box.upper)
    corners = np.array(np.meshgrid(*np.stack([low, high], axis=1))).reshape(3, -1).T
    middle = (low + high) / 2
    return hull_mesh((corners - middle) * scale + middle + (0, 0, raised))


def scene(frame, meshes):
    grid = GridSpec(16)
    volume = np.full(grid.shape, 0.1, np.float32)
    instances = np.zeros(grid.shape, np.int32)
    objects = estimate_objects(dict(enumerate(meshes, 1)), {})
    masks = np.where(FRAME.labels > len(meshes), 0, FRAME.labels).astype(np.int32)
    frame = replace(frame, camera=CAMERA)
    return SceneEstimate(objects, grid, volume, instances, frame, masks=masks)


class Method:
    """Knows the scene; refuses images with a hole in the first pixel."""

    def __init__(self, boxes=BOXES, obstacles=(), **change):
        self.meshes = [mesh_of(box, **change) for box in boxes]
        self.obstacles = obstacles

    def estimate(self, frame):
        if frame.depth[0, 0] == 0:
            raise InputError("no floor")
        return replace(scene(frame, self.meshes), obstacles=self.obstacles)


def save(path, depth=FRAME.depth, **arrays):
    path.parent.mkdir(exist_ok=True, parents=True)
    np.savez(path, depth=depth, K=CAMERA.matrix, **arrays)


@pytest.fixture
def folder(tmp_path):
    """Two groups: one with labels, whose second image is refused, one without; and a recording."""
    holed = FRAME.depth.copy()
    holed[0, 0] = 0
    unknown = np.where(FRAME.labels == 0, -1, FRAME.labels)
    save(tmp_path / "data" / "table" / "a.npz", instances=unknown)
    save(tmp_path / "data" / "table" / "b.npz", holed, instances=FRAME.labels)
    save(tmp_path / "data" / "wall" / "c.npz")
    save(tmp_path / "data" / "recording" / "depth" / "d.npz")
    return tmp_path / "data"


def test_figures_of_groups(folder):
    methods = {
        "all": Method(obstacles=(OBSTACLE,)), "first": Method(BOXES[:1], raised=0.1), "none": None,
    }  # fmt: skip
    result = RealImages(folder, methods, LABELS).run()
    assert list(result.groups) == ["table", "wall"]
    assert result.methods == ("all", "first", "rising")
    table = result.of("table", "all")
    assert {"images": 2, "refused": 1, "objects": 2, "true_objects": 4}.items() <= table.items()
    assert table["count_error"] == 1  # 0, and 2 in the refused one
    assert table["overlap_f"] == table["cut_overlap_f"] == 0.5
    assert (table["flagged"], table["obstacles"]) == (0, 1)
    first = result.of("table", "first")
    assert first["hovering"] == first["flagged"] == 1
    assert first["count_error"] == 1.5
    rising = result.of("table", "rising")
    assert "flagged" not in rising
    assert 0.2 < rising["overlap_f"] < 0.5
    assert "overlap_f" not in result.of("wall", "all")
    assert result.figures["wall/first/flagged"] == 1
    assert result.measures.keys() >= result.figures.keys()
    measures = result.measures
    assert measures["table/all/overlap_f"].trivial == "table/rising/overlap_f"


def test_what_is_unlabelled_counts_in_strict_scores_alone(tmp_path):
    one = np.where(FRAME.labels == 1, 1, -1)
    save(tmp_path / "a.npz", instances=one)
    result = RealImages(tmp_path, {"all": Method()}, LABELS).run()
    figures = result.of(tmp_path.name, "all")
    assert figures["cut_overlap_f"] == 1
    assert 0.5 < figures["overlap_f"] < 0.95


def test_odd_objects_have_names():
    flags = odd_objects(scene(FRAME, [mesh_of(BOXES[0]), mesh_of(BOXES[1], scale=4.0)]), FRAME)
    assert not flags[1]
    assert {"below", "long", "free"} <= flags[2]


def test_an_object_may_stand_on_the_middle_of_a_wide_side():
    """Corners alone would be far from it."""
    board = mesh_of(Box((-0.3, -0.3, 0.0), (0.3, 0.3, 0.05)))
    top = mesh_of(Box((-0.02, -0.02, 0.05), (0.02, 0.02, 0.1)))
    assert "hovering" not in odd_objects(scene(FRAME, [board, top]), FRAME)[2]


def test_labels_are_asked_for_one_after_another(tmp_path):
    save(tmp_path / "a.npz")
    shape = {"label": "x", "points": [[0, 0], [50, 0], [50, 50]], "shape_type": "polygon"}
    outline = {"imageHeight": 240, "imageWidth": 320, "shapes": [shape]}
    (tmp_path / "a.rgb.json").write_text(json.dumps(outline))
    labels = {**LABELS, "none": None, "outlined": Outlines()}
    result = RealImages(tmp_path, {"all": Method()}, labels).run()
    assert result.of(tmp_path.name, "all")["true_objects"] == 1
    outline["imageWidth"] = 100
    (tmp_path / "a.rgb.json").write_text(json.dumps(outline))
    with pytest.raises(LabelsError, match="100 x 240 pixels, its depth of 320 x 240"):
        RealImages(tmp_path, {"all": Method()}, labels).run()


def test_an_unreadable_image_is_refused_and_told(folder, tmp_path):
    (folder / "wall" / "e.npz").write_bytes(b"nothing")
    result = RealImages(folder, {"all": Method()}, LABELS).run()
    assert result.of("wall", "all")["refused"] == 1
    sections = Chapter("scenefw_single_view_benchmarks.report").sections(result, tmp_path / "page")
    assert any(
        "e (all)" in line
        for s in sections
        for b in s.blocks
        if hasattr(b, "points")
        for line in b.points
    )


def test_wrong_calls_are_told(tmp_path):
    with pytest.raises(ConfigError, match="input=FOLDER"):
        RealImages(None, {"all": Method()}, {})
    with pytest.raises(ConfigError, match="nothing to evaluate"):
        RealImages(tmp_path, {"all": None}, {})
    with pytest.raises(InputError, match="no depth image"):
        RealImages(tmp_path, {"all": Method()}, {}).run()


def test_sections_have_tables_refusals_and_pictures(folder, tmp_path):
    earlier = {"name": "as it was", "figures": {"table": {"overlap_f": 0.25, "flagged": 3}}}
    methods = {"all": Method(), "first": Method(BOXES[:1])}
    result = RealImages(folder, methods, LABELS, about="Boxes.", earlier=earlier).run()
    table, wall = Chapter("scenefw_single_view_benchmarks.report").sections(
        result, tmp_path / "page"
    )
    masks, objects, refused, overlay, picture = table.blocks
    headings = [column.name for column in masks.columns]
    rows = dict(masks.rows)
    assert list(rows) == ["all", "first", "one object: all that rises", "as it was"]
    assert rows["all"][headings.index("overlap F")] == pytest.approx(50)
    assert rows["as it was"][headings.index("overlap F")] == pytest.approx(25)
    assert masks.quoted == {"as it was"}
    assert dict(objects.rows)["as it was"][1] == 3
    assert objects.note.endswith("Boxes.")
    assert refused.points == ("b (all): no floor", "b (first): no floor")
    assert (overlay.shareable, picture.shareable) == (False, True)  # images may not be ours
    assert all((tmp_path / "page" / block.path).is_file() for block in (overlay, picture))
    assert [block.title for block in wall.blocks[:1]] == ["Objects"]
    assert wall.blocks[0].note == ""
