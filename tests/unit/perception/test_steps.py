"""What the steps of a pipeline get from those before them."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.perception.pipelines import KnownBoxes, pipeline_of
from tests.unit.perception.synthetic import camera_at, frame_of

from scenefw import config
from scenefw.core.errors import InputError
from scenefw.core.types import GridSpec
from scenefw.execution.build import Builder
from scenefw.mapping.projective import Projective
from scenefw.perception.steps import Fits, Objects

GRID = GridSpec(resolution=32)
CAMERA = camera_at(eye=(0.0, -0.85, 0.6))


class Recorder:
    """All steps between segments and hollow objects, which keep the views that they are shown."""

    def __init__(self):
        self.views, self.boxes = {}, KnownBoxes(GRID)
        self.grid, self.metadata = GRID, {}

    def segment(self, view):
        self.views["segmentation"] = view
        return np.ones(view.depth.shape, np.int32)

    def restore(self, view, segments):
        """2 cm farther away, and with segments of another number."""
        self.views["edges"] = view
        depth = view.depth + np.float32(0.02)
        return view.restored(depth, Projective()), 2 * segments

    def group(self, segments, view):
        self.views["grouping"], self.segments = view, segments
        return self.boxes.group(segments, view)

    def fit(self, objects, view):
        self.views["fit"], self.objects = view, objects
        return Fits(objects)

    def complete(self, fits, view, samples, generator):
        self.views["completion"], self.fits = view, fits
        return self.boxes.complete(fits, view, samples, generator)

    def replace(self, sets, view):
        self.views["hollow"], self.sets = view, sets
        return [replace(each, objects=replace(each.objects, volumes={})) for each in sets]


def test_edges_are_restored_before_all_further_steps():
    steps = Recorder()
    names = ("segmentation", "edges", "grouping", "fit", "completion", "hollow")
    pipeline = pipeline_of(**dict.fromkeys(names, steps), samples=2)
    seen = pipeline.observe(frame_of(CAMERA))
    scenes = pipeline.reconstruct(seen)
    assert list(steps.views) == list(names)
    assert steps.views["segmentation"] is steps.views["edges"] is seen
    restored = steps.views["grouping"]
    np.testing.assert_allclose(restored.depth, seen.depth + 0.02, atol=1e-6)
    assert restored.noise is seen.noise
    apart = restored.points - seen.points
    assert np.nanmin(np.linalg.norm(apart, axis=-1)) > 0.0199
    assert not np.array_equal(restored.free, seen.free)
    assert all(steps.views[name] is restored for name in names[3:])
    assert set(np.unique(steps.segments)) == {2}
    assert steps.objects is steps.fits.objects
    assert steps.objects.masks is steps.segments
    assert len(steps.sets) == len(scenes) == 2
    assert all(scene.volumes == {} for scene in scenes)  # those of the last step


def test_steps_that_are_left_out_change_nothing():
    steps = Recorder()
    pipeline = pipeline_of(segmentation=steps, grouping=steps, grid=GRID, samples=2)
    first, second = pipeline(frame_of(CAMERA))
    assert list(steps.views) == ["segmentation", "grouping"]
    for scene in (first, second):
        assert len(scene.objects) == 2
        np.testing.assert_array_equal(scene.tsdf, first.tsdf)


def test_objects_that_no_pixel_shows_are_told():
    with pytest.raises(InputError, match="doesn't say which pixels show its objects"):
        _ = Objects(None).pixels


def test_a_step_is_left_out_by_one_word():
    """`~hollow` on the command line; without it the step is there."""
    steps = ("edges", "hollow", "ranking")
    words = ["run=predict", "input=x", "device=cpu"]
    full, left_out = (
        Builder(config.compose([*words, *more])).build("run.pipeline")
        for more in ([], [f"~{step}" for step in steps])
    )
    for step in steps:
        assert getattr(full, step) is not None
        assert getattr(left_out, step) is None


def test_segments_are_cut_along_regions_and_left_out_beside_them():
    steps = Recorder()
    names = ("segmentation", "grouping", "fit", "completion")
    pipeline = pipeline_of(**dict.fromkeys(names, steps), samples=1)
    view = pipeline.observe(frame_of(CAMERA))
    regions = np.zeros(view.depth.shape, np.int32)
    regions[:, :50], regions[:, 50:80] = 1, 5
    pipeline.reconstruct(view, regions=regions)
    first, second = np.unique(steps.segments[:, :50]), np.unique(steps.segments[:, 50:80])
    assert len(first) == len(second) == 1
    assert 0 < first[0] != second[0] > 0
    assert not steps.segments[:, 80:].any()
