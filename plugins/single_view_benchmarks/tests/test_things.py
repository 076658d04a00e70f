"""The evaluation of things, with a method that knows the truth and references on exact images."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest
import trimesh

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.types import Camera, Frame, Pose, TriangleMesh
from scenefw.perception.estimate.objects import estimate_objects
from scenefw.perception.estimate.shape_cues import CUES
from scenefw_annotated_views.annotations import AnnotatedObject, AnnotatedView
from scenefw_annotated_views.silhouettes import SolidViews
from scenefw_simulators.body_maker import BodyMaker
from scenefw_single_view_benchmarks import things
from scenefw_single_view_benchmarks.confidence_results import ObjectConfidence
from scenefw_single_view_benchmarks.optional_views import posed_folder
from scenefw_single_view_benchmarks.report.things import thing_sections
from scenefw_single_view_benchmarks.shape_methods import PredictedScene
from scenefw_single_view_benchmarks.things import ThingsEvaluation
from scenefw_single_view_benchmarks.things_results import (
    METHOD_MASKS,
    TRUE_MASKS,
    Draws,
    Standing,
    ThingImage,
    ThingsResult,
)
from scenefw_single_view_benchmarks.true_things import TrueThings

UPRIGHT = np.array([1.0, 0, 0, 0])
SIDES = {"box": (0.08, 0.06, 0.1), "book": (0.1, 0.14, 0.03)}
PLACES = {"box": (-0.08, 0.0, 0.05), "book": (0.1, 0.02, 0.015)}


def camera():
    """Looks at the origin from one side and above."""
    down = np.arctan2(0.6, 0.7)
    pose = np.eye(4)
    pose[:3, :3] = np.array(
        [[1, 0, 0], [0, -np.sin(down), np.cos(down)], [0, -np.cos(down), -np.sin(down)]]
    )
    pose[:3, 3] = (0, -0.7, 0.6)
    return Camera(160, 120, 145, 145, 79.5, 59.5, pose)


def mesh_of(name):
    box = trimesh.creation.box(SIDES[name])
    return TriangleMesh(np.asarray(box.vertices), np.asarray(box.faces))


class Boxes:
    """Two scenes of a box and a book, each seen once."""

    split, categories = "val", ("object",)

    def __len__(self):
        return 2

    def objects(self, scene):
        return tuple(
            AnnotatedObject(f"toys/{name}", mesh_of(name), Pose(np.array(place), UPRIGHT), 0)
            for name, place in PLACES.items()
        )

    def views(self, scene, count):
        objects = self.objects(scene)
        solids = SolidViews(
            [TriangleMesh(o.mesh.vertices + o.pose.position, o.mesh.faces) for o in objects]
        )
        depth, silhouettes = solids.see(camera())
        yield AnnotatedView(Frame(depth, camera()), objects, tuple(silhouettes))


class Oracle:
    """A pipeline that gives the true objects, further ones in drawn sizes; or refuses."""

    def __init__(self, samples=1, refuses=False):
        self.samples, self.refuses = samples, refuses

    def observe(self, frame, marks):
        if self.refuses:
            raise InputError("too dark")
        return frame, marks


class Truth:
    """A reference with the true objects; one of them in another size."""

    def __init__(self, scale=1.0):
        self.scale = scale

    def scene(self, view):
        frame, _ = view
        return true_scene(frame, self.scale)


def true_scene(frame, scale=1.0, moved=0.0):
    (view,) = Boxes().views(0, 1)
    meshes, masks = {}, np.zeros(frame.depth.shape, np.int32)
    for label, (item, shown) in enumerate(zip(view.objects, view.silhouettes, strict=True), 1):
        masks[shown.visible] = label
        size = scale if label == 1 else 1.0
        vertices = item.mesh.vertices * size + item.pose.position + (moved, 0, 0)
        meshes[label] = TriangleMesh(vertices, item.mesh.faces)
    objects = estimate_objects(meshes, {1: 0.9, 2: 0.7})
    cues = dict.fromkeys(CUES, 0.5)
    return PredictedScene(tuple(replace(item, cues=cues) for item in objects), masks, frame.camera)


class StillEngine:
    """Nothing moves."""

    def reset(self):
        self.poses = []

    def add(self, item):
        self.poses.append(item.pose)
        return len(self.poses) - 1

    def settle(self, steps):
        return True

    def pose(self, handle):
        return self.poses[handle]


@pytest.fixture
def evaluation(monkeypatch):
    def scenes(pipeline, view, count):
        return [true_scene(view[0], moved=0.004 * i) for i in range(count)]

    monkeypatch.setattr(things, "pipeline_scenes", scenes)

    def made(pipeline, reference=None, **settings):
        return ThingsEvaluation(
            {"few": {"none": Boxes(), "kinect": None}},
            {"set_extents": pipeline, "other": None},
            {"hull": reference or Truth(1.2)},
            StillEngine(),
            BodyMaker(),
            **{"draws": 3, "draw_scenes": 1, "min_pixels": 100, "workers": 1, **settings},
        )

    return made


def test_true_objects_have_perfect_scores(evaluation):
    result = evaluation(Oracle()).run()
    (images,) = [result.of("few", "none")]
    assert [image.kinds for image in images] == [("toys/box", "toys/book")] * 2
    figures = result.figures
    for group in (METHOD_MASKS, TRUE_MASKS):
        row = f"few/none/{group}/set_extents"
        for name in ("matches", "recall", "f_5", "f_10", "iou", "size_ratio", "size_error"):
            assert figures[f"{row}/{name}"] == pytest.approx(1), (group, name)
        for name in ("chamfer", "chamfer_visible", "chamfer_hidden"):
            assert figures[f"{row}/{name}"] < 1e-6
    assert figures["few/none/masks/set_extents/overlap_f"] == 1
    assert figures["few/none/masks/set_extents/seam_f"] == pytest.approx(0)  # they don't touch
    assert figures["few/none/masks/rising/objects_f75"] <= 0.5 < 1
    assert figures["few/none/standing/set_extents/stable"] == 1
    assert figures["few/none/images"] == 2
    assert figures["few/none/objects"] == 4


def test_a_box_that_is_too_large_costs_what_it_should(evaluation):
    figures = evaluation(Oracle()).run().figures
    row = "few/none/method_masks/hull"
    volume = 1.2**3
    assert figures[f"{row}/size_ratio"] == pytest.approx(volume**0.5, rel=1e-6)
    assert figures[f"{row}/size_error"] == pytest.approx(volume**0.5, rel=1e-6)
    assert figures[f"{row}/iou"] == pytest.approx((1 + 1 / volume) / 2, abs=0.04)
    assert 0 < figures[f"{row}/chamfer"] < 0.01
    assert figures["few/none/standing/hull/penetrating"] == 0.5  # 1 cm below the floor


def test_hypotheses_are_judged_on_the_first_scenes(evaluation):
    result = evaluation(Oracle()).run()
    assert [bool(image.draws) for image in result.images] == [True, False]
    draws = result.images[0].draws
    assert draws["set_extents"].first < 1e-6
    assert draws["set_extents"].best < 1e-6
    moved = 0.5 * (draws["hull"].energy + draws["hull"].best)
    assert draws["hull"].first == pytest.approx(moved)  # one hypothesis
    assert 0 <= draws["set_extents"].energy < 0.002  # as the mean of 0, 4 and 8 mm, less spread


def test_a_refused_image_has_no_objects(evaluation):
    result = evaluation(Oracle(refuses=True)).run()
    figures = result.figures
    for method in ("set_extents", "hull"):
        assert result.images[0].refusals[method] == "too dark"
        assert figures[f"few/none/masks/{method}/overlap_f"] == 0
        assert figures[f"few/none/method_masks/{method}/iou"] == 0
        assert figures[f"few/none/method_masks/{method}/matches"] == 0
        assert f"few/none/method_masks/{method}/chamfer" not in figures


def test_an_image_comes_back_from_json(evaluation):
    image = evaluation(Oracle()).score("few", "none", 0)
    again = ThingImage.restored(json.loads(json.dumps(asdict(image))))
    assert again == image


def test_results_become_sections(evaluation):
    sections = thing_sections(evaluation(Oracle(), about="Boxes.").run())
    titles = [section.title for section in sections]
    assert titles == [
        "What is compared", "3 or 4 things", "By kind of thing", "Figures of others"
    ]  # fmt: skip
    tables = {table.title: table for table in sections[1].blocks}
    assert list(tables) == [
        "Masks", "Shapes, objects as found", "Shapes, objects marked", "Hypotheses", "Confidence",
        "Can the scene stand?",
    ]  # fmt: skip
    assert [name for name, _ in tables["Masks"].rows] == [
        "no noise: set extents", "no noise: hull", "no noise: one object: all that rises"
    ]  # fmt: skip
    assert "mean of both directions" in tables["Shapes, objects as found"].note
    (kinds,) = sections[2].blocks
    assert [name for name, _ in kinds.rows] == ["book", "box"]


def test_objects_are_matched_by_pixels_and_small_ones_count_for_nothing():
    (view,) = Boxes().views(0, 1)
    truth = TrueThings.of(view, 100, 0.006)
    scene = true_scene(view.frame)
    swapped = replace(scene, masks=np.array([0, 2, 1], np.int32)[scene.masks])
    assert truth.matches(scene) == {1: 1, 2: 2}
    assert truth.matches(swapped) == {1: 2, 2: 1}
    lost = replace(scene, masks=np.where(scene.masks == 1, 0, scene.masks))
    assert truth.matches(lost) == {2: 2}
    few = min(int((truth.labels == number).sum()) for number in (1, 2))
    smaller = TrueThings.of(view, (few + 1) * (640 / 160) ** 2, 0.006)
    assert len(smaller.kinds) == 1
    assert (smaller.labels == -1).sum() >= few
    assert len(smaller.all_shapes) == 2


def test_figures_are_means_over_scenes(tmp_path):
    row = {"chamfer": 0.002, "chamfer_visible": 0.001, "chamfer_hidden": float("nan"), "f_5": 1.0,
           "f_10": 1.0, "iou": 0.6, "size_ratio": 2.0}  # fmt: skip
    worse = {**row, "chamfer": 0.006, "iou": 0.2, "size_ratio": 0.5}
    seams = {"hits": 0, "predicted": 10, "true_hits": 0, "true": 10}
    full = {"hits": 10, "predicted": 10, "true_hits": 10, "true": 10}
    images = [
        ThingImage("few", "none", 0, ("a", "b"), shapes={METHOD_MASKS: {"m": [row, None]}},
                   masks={"m": {"overlap_f": 1.0, **seams}},
                   draws={"m": Draws(0.1, 0.2, 0.3)}, standing={"m": Standing(1, 0.0, 0, 0)},
                   confidences=(ObjectConfidence("few/none", 0, False, 0.6, 0.5, {}),)),
        ThingImage("few", "none", 1, ("a",), shapes={METHOD_MASKS: {"m": [worse]}},
                   masks={"m": {"overlap_f": 0.5, **full}}),
    ]  # fmt: skip
    result = ThingsResult(tuple(images), ("m",), (), 0.006, 10)

    def mean(group, name):
        return result.interval(images, group, "m", name).mean

    assert mean(METHOD_MASKS, "chamfer") == pytest.approx(0.004)  # of what was matched
    assert mean(METHOD_MASKS, "iou") == pytest.approx((0.6 / 2 + 0.2) / 2)  # scenes count alike
    assert mean(METHOD_MASKS, "recall") == pytest.approx(0.25)
    assert mean(METHOD_MASKS, "matches") == pytest.approx(0.75)
    assert mean(METHOD_MASKS, "size_ratio") == pytest.approx(1)
    assert mean(METHOD_MASKS, "size_error") == pytest.approx(2)
    assert np.isnan(mean(METHOD_MASKS, "chamfer_hidden"))
    assert mean("masks", "overlap_f") == 0.75
    assert mean("masks", "seam_f") == pytest.approx(0.5)  # pixels are added up
    assert mean("draws", "energy") == 0.2


def test_what_is_missing_is_said(evaluation):
    with pytest.raises(ConfigError, match="nothing to evaluate"):
        evaluation(None)
    with pytest.raises(ConfigError, match="2 or more"):
        evaluation(Oracle(), draws=1)
    with pytest.raises(ConfigError, match="input=FOLDER"):
        posed_folder(None)
