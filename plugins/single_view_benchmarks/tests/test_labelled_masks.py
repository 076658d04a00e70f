"""Instances of pixels from volumes: boxes whose labels are known, at two resolutions."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import grey_dilation
from scipy.spatial import ConvexHull
from tests.unit.perception.blurred import seen

from scenefw.core.errors import ConfigError, InputError, LabelsError
from scenefw.core.geometry import look_at, transform_points
from scenefw.core.types import Camera, Frame, GridSpec, SceneEstimate
from scenefw.perception.evidence.visible_instances import visible_instances
from scenefw.perception.observation.observation import Observation
from scenefw.perception.observation.points import world_points
from scenefw.perception.segmentation.colour_edges import ColourEdges
from scenefw.perception.segmentation.crease_segmentation import CreaseSegmentation
from scenefw_single_view_benchmarks.labelled_masks import LabelledMasks
from scenefw_single_view_benchmarks.mask_scores import mask_scores
from scenefw_single_view_benchmarks.outlines import Outlines
from scenefw_single_view_benchmarks.stored_labels import StoredLabels

CAMERA = Camera(160, 120, 150.0, 150.0, 79.5, 59.5, look_at((0.5, -0.5, 0.6), (0.0, 0.0, 0.05)))
BOXES = [((-0.15, -0.1, 0.0), (0.0, 0.1, 0.1)), ((0.0, -0.1, 0.0), (0.15, 0.1, 0.15))]


def _frame(boxes=BOXES):
    """Depth of boxes on the floor by slab intersection, and their labels."""
    v, u = np.indices((CAMERA.height, CAMERA.width))
    rays = np.stack(
        [(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones_like(u)], axis=-1
    )
    origin = CAMERA.T_world_camera[:3, 3]
    directions = transform_points(CAMERA.T_world_camera, rays) - origin
    depth = -origin[2] / directions[..., 2]
    labels = np.zeros(depth.shape, np.int32)
    for label, (low, high) in enumerate(boxes, start=1):
        a, b = (low - origin) / directions, (high - origin) / directions
        enter, leave = np.minimum(a, b).max(-1), np.maximum(a, b).min(-1)
        hit = (enter < leave) & (enter < depth)
        depth[hit], labels[hit] = enter[hit], label
    return Frame(depth.astype(np.float32), CAMERA, labels=labels, name="boxes")


def _estimate(frame, resolution, boxes=BOXES):
    grid = GridSpec(resolution)
    centres = grid.centres()
    instances = np.zeros(grid.shape, np.int32)
    for label, (low, high) in enumerate(boxes, start=1):
        instances[np.all((centres > low) & (centres < high), axis=-1)] = label
    return SceneEstimate((), grid, np.zeros(grid.shape, np.float32), instances, frame)


def _shown(estimate):
    """What the pixels more than 5 mm above the floor show."""
    points = world_points(estimate.frame)
    above = points[..., 2] > 0.005
    return visible_instances(estimate.instances, points, estimate.grid, above)


class _Method:
    """Knows scene and camera; finds no floor in images with a hole in the first pixel."""

    def estimate(self, frame):
        if frame.depth[0, 0] == 0:
            raise InputError("no floor")
        return _estimate(replace(frame, camera=CAMERA), 64)


def _save(path, frame, **arrays):
    np.savez(path, depth=frame.depth, K=CAMERA.matrix, **arrays)


@pytest.mark.parametrize("resolution", [32, 64])
def test_borders_come_from_the_image(resolution):
    frame = _frame()
    found = _shown(_estimate(frame, resolution))
    scores = mask_scores(found, frame.labels)
    # a voxel is about 5 (64) or 10 pixels wide here, yet outlines are sharp to a pixel
    assert scores.overlap_f > 0.97
    assert np.mean((found > 0) == (frame.labels > 0)) > 0.99


def test_border_between_touching_boxes_is_no_staircase():
    frame = _frame()
    found = _shown(_estimate(frame, 32))
    both = (found > 0) & (frame.labels > 0)
    assert np.mean(found[both] == frame.labels[both]) > 0.98


def test_floor_distant_points_and_holes_belong_to_nothing():
    frame = _frame()
    depth = frame.depth.copy()
    depth[:20] = 0
    estimate = _estimate(replace(frame, depth=depth), 64, BOXES[:1])
    found = _shown(estimate)
    assert not found[:20].any()
    assert not found[frame.labels == 0].any()
    box = _estimate(frame, 64, BOXES[:1])
    assert np.mean(_shown(box)[frame.labels == 2] > 0) < 0.2  # only what is within reach


def test_run_gives_means_of_method_and_reference(tmp_path):
    frame = _frame()
    _save(tmp_path / "a.npz", frame, instances=frame.labels)
    _save(tmp_path / "c.npz", frame)
    result = LabelledMasks(
        tmp_path, _Method(), CreaseSegmentation(min_pixels=50), StoredLabels()
    ).run()
    figures = result.figures
    assert (figures["images"], figures["failures"]) == (1, 0)
    assert figures["overlap_f"] == result.images[0].scores.overlap_f > 0.95
    assert figures["count_error"] == 0
    assert figures["reference/count_error"] == result.images[0].reference.count_error
    assert {"boundary_f", "objects_f75", "reference/boundary_f"} <= set(figures)


def _outline(path, boxes=BOXES, size=(120, 160)):
    """LabelMe's file of the boxes' silhouettes, hulls of their corners, the nearest last."""
    shapes = []
    eye = CAMERA.T_world_camera[:3, 3]
    behind_first = sorted(boxes, key=lambda box: -np.linalg.norm(np.mean(box, axis=0) - eye))
    for low, high in behind_first:
        corners = np.array(list(itertools.product(*zip(low, high, strict=True))))
        local = transform_points(np.linalg.inv(CAMERA.T_world_camera), corners)
        u = local[:, :2] / local[:, 2:] * (CAMERA.fx, CAMERA.fy) + (CAMERA.cx, CAMERA.cy)
        hull = u[ConvexHull(u).vertices].tolist()
        shapes.append({"label": "box", "points": hull, "shape_type": "polygon", "group_id": None})
    content = {"imageHeight": size[0], "imageWidth": size[1], "shapes": shapes}
    path.write_text(json.dumps(content))


def test_outlines_score_as_labels_of_pixels_do(tmp_path):
    frame = _frame()
    _save(tmp_path / "a.npz", frame, instances=frame.labels)
    _save(tmp_path / "b.npz", frame)
    _outline(tmp_path / "a.rgb.json")
    plain = CreaseSegmentation(min_pixels=50)
    drawn = LabelledMasks(tmp_path, _Method(), plain, Outlines()).run()
    stored = LabelledMasks(tmp_path, _Method(), plain, StoredLabels()).run()
    assert [image.name for image in drawn.images] == ["a"]
    for name in ("overlap_f", "boundary_f"):
        assert drawn.figures[name] == pytest.approx(stored.figures[name], abs=0.02)
    assert drawn.figures["count_error"] == 0


def test_pixels_without_depth_count_for_nothing(tmp_path):
    frame = _frame()
    depth = frame.depth.copy()
    depth[frame.labels == 1] = 0
    _save(tmp_path / "a.npz", replace(frame, depth=depth), instances=frame.labels)
    (image,) = LabelledMasks(tmp_path, _Method(), CreaseSegmentation(), StoredLabels()).run().images
    assert (image.labels["true"][frame.labels == 1] == -1).all()
    assert image.scores.true == 1


def test_outlines_of_another_size_are_one_line(tmp_path):
    _save(tmp_path / "a.npz", _frame())
    _outline(tmp_path / "a.rgb.json", size=(240, 320))
    _save(tmp_path / "b.npz", _frame())
    _outline(tmp_path / "b.rgb.json")  # a good one doesn't hide it
    with pytest.raises(LabelsError, match="320 x 240 pixels, its depth of 160 x 120"):
        LabelledMasks(tmp_path, _Method(), CreaseSegmentation(), Outlines()).run()


def test_published_figures_are_of_published_images_alone(tmp_path):
    _save(tmp_path / "a.npz", _frame(), instances=_frame().labels)

    def measures(**about):
        return (
            LabelledMasks(tmp_path, _Method(), CreaseSegmentation(), StoredLabels(), **about)
            .run()
            .measures
        )

    assert measures()["overlap_f"].published is None
    assert measures(published=True)["overlap_f"].published == pytest.approx(0.833)


class _Blind:
    """Finds one object in everything."""

    def estimate(self, frame):
        estimate = _estimate(replace(frame, camera=CAMERA), 32)
        return replace(estimate, masks=np.ones(frame.depth.shape, np.int32))


def test_methods_beside_have_rows_of_their_own(tmp_path):
    _save(tmp_path / "a.npz", _frame(), instances=_frame().labels)
    beside = {"blind": _Blind(), "left_out": None}
    result = LabelledMasks(
        tmp_path, _Method(), CreaseSegmentation(min_pixels=50), StoredLabels(), beside=beside
    ).run()
    alone = (
        LabelledMasks(tmp_path, _Blind(), CreaseSegmentation(min_pixels=50), StoredLabels())
        .run()
        .figures
    )
    assert result.beside == ("blind",)
    for name in ("overlap_f", "boundary_f", "seam_f", "count_error"):
        assert result.figures[f"blind/{name}"] == alone[name]
        assert f"blind/{name}" in result.measures
    assert result.figures["overlap_f"] > 0.95 > alone["overlap_f"]


def test_masks_count_as_they_are_and_margins_take_from_both(tmp_path):
    """Masks that cover floor, of a method that says so, cost it; at a margin that floor is gone."""
    frame = _frame()
    _save(tmp_path / "a.npz", frame, instances=frame.labels)
    wide = grey_dilation(frame.labels, size=(7, 7))

    class Wide:
        def estimate(self, frame):
            return replace(_estimate(replace(frame, camera=CAMERA), 32), masks=wide)

    plain = CreaseSegmentation(0.005, min_pixels=50)
    result = LabelledMasks(tmp_path, Wide(), plain, StoredLabels(), margins=[0.005, 0.03]).run()
    figures, expected = result.figures, mask_scores(wide, frame.labels)
    assert figures["overlap_precision"] == expected.overlap_precision < 0.97
    heights = world_points(frame)[..., 2]
    for margin, where in ((0.005, "5 mm"), (0.03, "30 mm")):
        low = heights <= margin
        for prefix, labels in (
            ("", wide),
            ("reference/", CreaseSegmentation(margin, min_pixels=50).segment(Observation(frame))),
        ):
            cut = mask_scores(np.where(low, 0, labels), frame.labels)
            assert figures[f"{prefix}{where}/overlap_f"] == pytest.approx(cut.overlap_f)
            assert figures[f"{prefix}{where}/boundary_f"] == pytest.approx(cut.boundary_f)
    assert figures["5 mm/overlap_f"] > figures["overlap_f"]


def test_ends_of_the_reference_move_to_colour(tmp_path):
    sharp, blurred, _ = seen((640, 480), 6)
    paint = np.where(sharp.labels[..., None] > 0, [200, 60, 40], [90, 90, 80]).astype(np.uint8)
    np.savez(
        tmp_path / "a.npz", depth=blurred.depth, K=blurred.camera.matrix, rgb=paint,
        instances=sharp.labels,
    )  # fmt: skip

    class Placed:
        def estimate(self, frame):
            placed = replace(frame, camera=blurred.camera)
            return replace(_estimate(placed, 32), masks=sharp.labels)

    def boundary(colour):
        run = LabelledMasks(tmp_path, Placed(), CreaseSegmentation(), StoredLabels(), colour).run()
        assert run.figures["overlap_f"] == 1
        return run.figures["reference/boundary_f"]

    assert boundary(ColourEdges()) > boundary(None) + 0.05


def test_every_figure_at_a_margin_has_its_measure(tmp_path):
    _save(tmp_path / "a.npz", _frame(), instances=_frame().labels)
    result = LabelledMasks(
        tmp_path, _Method(), CreaseSegmentation(), StoredLabels(), margins=[0.008]
    ).run()
    assert result.figures.keys() <= result.measures.keys()
    measure = result.measures["8 mm/overlap_f"]
    assert measure.trivial == "reference/8 mm/overlap_f"
    assert measure.published is None  # theirs has no margin


def test_seams_are_added_up_over_images_and_failures(tmp_path):
    frame = _frame()
    hole = frame.depth.copy()
    hole[0, 0] = 0
    _save(tmp_path / "a.npz", frame, instances=frame.labels)
    one = LabelledMasks(
        tmp_path, _Method(), CreaseSegmentation(min_pixels=50), StoredLabels()
    ).run()
    assert one.figures["seam_f"] > 0.9
    _save(tmp_path / "b.npz", replace(frame, depth=hole), instances=frame.labels)
    both = LabelledMasks(
        tmp_path, _Method(), CreaseSegmentation(min_pixels=50), StoredLabels()
    ).run()
    assert both.figures["seam_recall"] == pytest.approx(one.figures["seam_recall"] / 2)
    assert both.figures["seam_precision"] == one.figures["seam_precision"]


SHARES = [
    f"{name}{what}" for name in ("overlap_", "boundary_") for what in ("f", "precision", "recall")
] + ["objects_f75"]


def test_images_that_fail_count_as_nothing_found(tmp_path):
    """One without a floor, one without a measurement; unlabelled ones are left out all the same."""
    frame = _frame()
    hole, empty = frame.depth.copy(), np.zeros_like(frame.depth)
    hole[0, 0] = 0
    _save(tmp_path / "a.npz", frame, instances=frame.labels)
    _save(tmp_path / "b.npz", replace(frame, depth=hole), instances=frame.labels)
    _save(tmp_path / "c.npz", replace(frame, depth=hole))
    coded = 10 * frame.labels + 1
    _save(tmp_path / "d.npz", replace(frame, depth=empty), label=coded)
    _save(tmp_path / "e.npz", replace(frame, depth=empty))
    np.save(tmp_path / "f.npy", empty)
    result = LabelledMasks(
        tmp_path, _Method(), CreaseSegmentation(min_pixels=50), StoredLabels()
    ).run()
    assert [(f.name, f.objects) for f in result.failures] == [("b", 2), ("d", 2)]
    assert result.failures[0].reason == "no floor"
    assert "no measurement" in result.failures[1].reason
    figures, (image,) = result.figures, result.images
    assert (figures["images"], figures["failures"]) == (3, 2)
    for name in SHARES:
        assert figures[name] == pytest.approx(getattr(image.scores, name) / 3)
        assert figures[f"reference/{name}"] == pytest.approx(getattr(image.reference, name) / 3)
    assert image.scores.count_error == 0
    assert figures["count_error"] == pytest.approx((0 + 2 + 2) / 3)
    missed = image.reference.count_error
    assert figures["reference/count_error"] == pytest.approx((missed + 2 + 2) / 3)


def test_a_damaged_image_counts_as_nothing_found_of_an_unknown_number(tmp_path):
    frame = _frame()
    _save(tmp_path / "a.npz", frame, instances=frame.labels)
    whole = (tmp_path / "a.npz").read_bytes()
    (tmp_path / "b.npz").write_bytes(whole[: len(whole) // 2])
    result = LabelledMasks(
        tmp_path, _Method(), CreaseSegmentation(min_pixels=50), StoredLabels()
    ).run()
    figures = result.figures
    assert [(f.name, f.objects) for f in result.failures] == [("b", None)]
    assert figures["overlap_f"] == pytest.approx(result.images[0].scores.overlap_f / 2)
    assert figures["count_error"] == result.images[0].scores.count_error


def test_the_whole_folder_is_followed_by_a_bar(tmp_path):
    frame = _frame()
    for name in "ab":
        _save(tmp_path / f"{name}.npz", frame, instances=frame.labels)
    seen = []

    def track(paths, what):
        seen.append((len(paths), what))
        return paths

    LabelledMasks(tmp_path, _Method(), CreaseSegmentation(), StoredLabels()).run(track)
    assert seen == [(2, "labelled images")]


def test_unusable_input_is_one_line(tmp_path):
    frame = _frame()
    with pytest.raises(ConfigError, match="input=FOLDER"):
        LabelledMasks(None, _Method(), CreaseSegmentation(), StoredLabels())
    _save(tmp_path / "a.npz", frame)
    with pytest.raises(InputError, match="none of the 1 images"):
        LabelledMasks(tmp_path, _Method(), CreaseSegmentation(), StoredLabels()).run()
    frame.depth[0, 0] = 0
    _save(tmp_path / "a.npz", frame, instances=frame.labels)
    with pytest.raises(InputError, match="no floor"):
        LabelledMasks(tmp_path, _Method(), CreaseSegmentation(), StoredLabels()).run()
