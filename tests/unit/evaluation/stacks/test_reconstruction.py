"""The protocol with methods of known quality: the truth itself, nothing, and noise."""

import numpy as np
import pytest
import torch
from tests.unit.perception.pipelines import pipeline_of

from scenefw.core.batches import Completion
from scenefw.core.errors import ConfigError
from scenefw.core.types import GridSpec
from scenefw.data.batches.stacks import StackScenes, shipped_scenes
from scenefw.evaluation.kept_rows import KeptRows
from scenefw.evaluation.stacks.reconstruction import ReconstructionEvaluation
from scenefw.evaluation.stacks.seen_scenes import Streams
from scenefw.evaluation.stacks.surface_scores import SurfaceScoring
from scenefw.evaluation.stacks.training_mean import TrainingMean
from scenefw.evaluation.stacks.visibility import shown_pixels
from scenefw.kernels.superquadric_rays import first_hits
from scenefw.mapping.projective import Projective
from scenefw.perception.completion.partial_surface import PartialSurface
from scenefw.postprocessing.connected_components import ConnectedComponents
from scenefw.postprocessing.hough_voting import HoughVoting
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw.report.stacks.reconstruction import as_thesis, reconstruction_sections
from scenefw.representations.volumes import scene_volumes
from scenefw.scenes.cameras import RandomViewpoints
from scenefw_sweeps.local import Local

SCENES = 2
pytestmark = pytest.mark.skipif(not shipped_scenes().exists(), reason="no shipped data set")


class Oracle:
    """Knows the scenes and shows them one by one, instances from exact votes."""

    def __init__(self, scenes, grid, views):
        self.grid = grid
        volumes = scene_volumes(scenes.parameters(list(range(len(scenes)))), grid)
        found = [
            HoughVoting().extract(tsdf[0], votes, grid)[0]
            for tsdf, votes in zip(volumes.tsdf, volumes.votes, strict=True)
        ]
        pairs = [
            Completion(volumes.tsdf[i], found[i][None])
            for i in range(len(scenes))
            for _ in range(views)
        ]
        self.calls = iter(pairs)

    def complete(self, partial, grid, samples, generator):
        return [next(self.calls)] * samples


class Nothing:
    grid = None

    def complete(self, partial, grid, samples, generator):
        shape = (1, *grid.shape)
        return [
            Completion(torch.full(shape, grid.truncation), torch.zeros(shape, dtype=torch.int32))
        ]


class Coin:
    """Free space or noise, as the generator says: what each sample is depends on it alone."""

    grid = None

    def complete(self, partial, grid, samples, generator):
        fields = torch.randn(samples, 1, *grid.shape, generator=generator)
        return [Completion(field * grid.voxel_size, (field < 0).int()) for field in fields]


def evaluation(methods, scenes, **settings):
    return ReconstructionEvaluation(
        scenes,
        methods,
        RandomViewpoints(width=160, height=120),
        SphereTracer(),
        Projective(),
        extractors={"connected_components": ConnectedComponents()},
        surfaces=SurfaceScoring(dense_points=5000),
        **settings,
    )


@pytest.fixture(scope="module")
def result():
    scenes = StackScenes(split="test", limit=SCENES)
    grid = GridSpec(resolution=48)
    methods = {
        "oracle": Oracle(scenes, grid, 2),
        "partial_tsdf": pipeline_of(PartialSurface(ConnectedComponents())),
        "nothing": Nothing(),
    }
    return evaluation(methods, scenes, views=2, samples=3, workers=1).run()


def test_truth_scores_its_floor(result):
    figures = result.figures
    for name in ("chamfer_visible", "chamfer_full", "chamfer_full_dense"):
        assert abs(figures[f"{name}_excess"]) < 0.05 * figures[f"{name}_floor"]
        assert figures[name] == pytest.approx(figures[f"{name}_floor"] + figures[f"{name}_excess"])
    assert figures["fscore_1cm"] > 0.9  # 5000 points lie up to a centimetre apart
    assert figures["normal_consistency"] > 0.9
    assert figures["occupancy_bce"] == 0.0
    assert figures["occupancy_iou"] == 1.0
    assert figures["hidden_coverage"] == 1.0
    assert figures["instance_iou"] > 0.95
    assert figures["panoptic_quality"] > 0.95
    assert figures["count_error"] == 0.0


def test_references_are_worse(result):
    figures = result.figures
    assert figures["partial_tsdf/chamfer_full_excess"] > figures["chamfer_full_excess"] + 0.003
    assert figures["partial_tsdf/instance_iou"] < figures["instance_iou"]
    assert figures["connected_components/instance_iou"] <= figures["instance_iou"]
    assert "connected_components/chamfer_full" not in figures


def test_nothing_at_all_counts_as_absent(result):
    figures = result.figures
    assert figures["nothing/absent"] == 1.0
    assert figures["nothing/chamfer_full"] == figures["nothing/chamfer_visible"] == 1.0
    assert figures["nothing/instance_iou"] == figures["nothing/fscore_1cm"] == 0.0
    occupied = figures["nothing/occupancy_bce"] / 100  # every occupied voxel costs 100
    assert 0.001 < occupied < 0.1


def test_numbers_of_scenes_views_and_samples_are_told(result):
    assert result.scenes == SCENES
    assert len(result.views) == 2 * SCENES
    assert result.figures["views"] == 2 * SCENES
    assert result.figures["samples"] == 3
    assert len({view.visibility for view in result.views}) == 2 * SCENES
    assert all(0 < view.visibility < 0.7 for view in result.views)


def test_bins_of_visibility_hold_all_views(result):
    rows = result.by_visibility("oracle", "chamfer_full")
    assert sum(row.count for _, _, row in rows) == len(result.views)
    total = sum(row.mean * row.count for _, _, row in rows) / len(result.views)
    assert total == pytest.approx(result.figures["chamfer_full"])
    assert result.summary("oracle", "chamfer_full").sigma == pytest.approx(
        np.std([view.methods["oracle"]["chamfer_full"] for view in result.views])
    )


def test_a_seed_gives_the_same_figures_and_another_others():
    scenes = StackScenes(split="test", limit=1)
    runs = [
        evaluation({"coin": Coin()}, scenes, grid=GridSpec(resolution=16), seed=seed).score(0, 0)
        for seed in (0, 0, 1)
    ]
    assert runs[0] == runs[1]
    assert runs[0].visibility != runs[2].visibility


def test_figures_of_a_method_do_not_depend_on_others_beside_it():
    scenes, grid = StackScenes(split="test", limit=1), GridSpec(resolution=16)
    both = {"coin": Coin(), "other": Coin()}
    runs = [
        evaluation(methods, scenes, grid=grid, samples=samples).score(0, 0)
        for methods, samples in (
            ({"coin": Coin()}, 2),
            (dict(reversed(both.items())), 2),
            (both, 2),
        )
    ]
    alone, *beside = (run.methods["coin"] for run in runs)
    for figures in beside:
        assert figures == {name: alone[name] for name in figures}
    assert runs[0].floors == runs[1].floors


@pytest.mark.exhaustive
def test_views_side_by_side_give_the_same_figures():
    scenes = StackScenes(split="test", limit=3)
    coin = {"coin": Coin(), "partial_tsdf": pipeline_of(PartialSurface(ConnectedComponents()))}
    one, two = (
        evaluation(coin, scenes, grid=GridSpec(resolution=16), workers=workers).run()
        for workers in (1, 2)
    )
    assert one.figures == two.figures


@pytest.mark.exhaustive
def test_views_scored_by_other_processes_give_the_same_figures():
    scenes = StackScenes(split="test", limit=3)
    methods = {"partial_tsdf": pipeline_of(PartialSurface(ConnectedComponents()))}
    one, two = (
        evaluation(methods, scenes, grid=GridSpec(resolution=16), **where).run()
        for where in ({"workers": 1}, {"parallel": Local(2)})
    )
    assert one.figures == two.figures


def test_bad_settings_are_named():
    scenes = StackScenes(split="test", limit=1)
    with pytest.raises(ConfigError, match="grid"):
        evaluation({"nothing": Nothing()}, scenes)
    with pytest.raises(ConfigError, match=r"evaluation\.methods"):
        evaluation({}, scenes, grid=GridSpec())
    with pytest.raises(ConfigError, match="workers"):
        evaluation({"nothing": Nothing()}, scenes, grid=GridSpec(), workers=0)


class Failing(Nothing):
    """Nothing, until its third view."""

    def __init__(self, fails_at=None):
        self.calls, self.fails_at = 0, fails_at

    def complete(self, partial, grid, samples, generator):
        self.calls += 1
        if self.calls == self.fails_at:
            raise KeyboardInterrupt
        noise = torch.rand(1, *grid.shape, generator=generator) - 0.5
        return [Completion(noise * grid.truncation, (noise < 0).int())]


def test_an_interrupted_evaluation_goes_on_where_it_was(tmp_path):
    scenes = StackScenes(split="val", limit=SCENES)
    settings = {"views": 2, "samples": 1, "grid": GridSpec(resolution=24), "workers": 1}
    settings["mean"] = TrainingMean(StackScenes(split="train", limit=4))
    whole = evaluation({"noise": Failing()}, scenes, **settings).run()
    kept = KeptRows(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        evaluation({"noise": Failing(3)}, scenes, **settings, kept=kept).run()
    again = Failing()
    result = evaluation({"noise": again}, scenes, **settings, kept=kept).run()
    assert again.calls == 2 * SCENES - 2
    assert result.figures == whole.figures
    assert result.views == whole.views
    assert result.methods[-2:] == ("base_rate", "training_mean")
    assert 0 < result.figures["training_mean/occupancy_bce"] < 1
    sections = reconstruction_sections(result)
    assert "no measure of skill" in str(sections)


def test_figures_of_the_thesis_are_of_the_data_set(tmp_path):
    scenes = StackScenes(split="val", limit=1)
    settings = {"views": 1, "samples": 1, "grid": GridSpec(resolution=24), "workers": 1}
    rows = {}
    for data in ("superquadrics", "ycb", None):
        result = evaluation({"nothing": Nothing()}, scenes, **settings, published=data).run()
        rows[data] = result.measures["chamfer_full"].published
        text = str(as_thesis(result))
        assert ("SIMstack (thesis)" in text) == (data is not None)
        assert ("256 scenes" in text) == (data == "ycb")
    assert rows == {"superquadrics": 0.028, "ycb": 0.062, None: None}
    with pytest.raises(ConfigError, match="superquadrics, ycb"):
        evaluation({"nothing": Nothing()}, scenes, **settings, published="kitchen")


def test_objects_by_the_pixels_that_show_them(result):
    edges = (0, 1, 20, 100, np.inf)  # of 160 x 120
    bins = result.by_pixels(edges)
    objects = [iou for view in result.views for iou in view.objects["oracle"]]
    assert sum(one.count for one in bins) == len(objects) >= 2 * SCENES
    for method in ("oracle", "nothing"):
        mean = sum(one.count * one.iou[method] for one in bins) / len(objects)
        right = method == "oracle"
        assert mean > 0.95 if right else mean == 0
        assert all(one.recall[method] == float(right) for one in bins)
    assert bins[-1].low == 100
    assert bins[-1].count > 0.5 * len(objects)
    assert all(sum(view.pixels) < 160 * 120 for view in result.views)


def test_pixels_are_those_of_exact_rays():
    scenes, grid = StackScenes(split="test", limit=SCENES), GridSpec(resolution=96)
    seeing = evaluation({"nothing": Nothing()}, scenes, grid=grid, views=1).seeing
    for row in range(SCENES):
        batch = seeing.see(scenes, row, 0, Streams(1, 2, 3)).batches[grid]
        _, owners = first_hits(scenes.parameters([row], "cpu"), batch.cameras)
        exact = np.bincount(owners.numpy().ravel())
        shown = shown_pixels(SphereTracer(), batch.volumes, grid, batch.cameras)
        assert len(shown) > 1
        for label, pixels in shown.items():
            assert pixels == pytest.approx(exact[label], rel=0.1, abs=15)
