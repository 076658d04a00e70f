"""What codes change, with networks whose codes say nothing, or all."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from scenefw.core.batches import Completion
from scenefw.core.errors import ConfigError
from scenefw.core.types import GridSpec
from scenefw.data.batches.stacks import StackScenes, shipped_scenes
from scenefw.evaluation.kept_rows import KeptRows
from scenefw.mapping.projective import Projective
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw.scenes.cameras import RandomViewpoints
from scenefw_several_views.latent_space import LatentSpaceEvaluation, on_sphere
from scenefw_several_views.latent_space_gallery import LatentSpaceGallery
from scenefw_several_views.report.latent_space import latent_space_sections

pytestmark = pytest.mark.skipif(not shipped_scenes().exists(), reason="no shipped data set")
GRID = GridSpec(resolution=24)


class Blocks:
    """A block whose height a code says, by `strength` voxels for each unit; two objects."""

    grid = GRID
    model = SimpleNamespace(latent_size=4)

    def __init__(self, strength):
        self.strength, self.calls = strength, 0

    def complete_with(self, partial, grid, codes):
        self.calls += 1
        scenes = []
        for code in codes[:, 0]:
            high = 10 + round(self.strength * float(code[0]))
            tsdf = torch.full((1, *grid.shape), grid.truncation)
            tsdf[:, 6:18, 6:18, 2 : max(high, 3)] = -grid.truncation
            labels = (tsdf < 0).int()
            labels[:, 12:] *= 2
            scenes.append(Completion(tsdf, labels))
        return scenes


def evaluation(strength, **settings):
    settings = {"counts": (1, 2), "samples": 4, "steps": 4, "workers": 1} | settings
    return LatentSpaceEvaluation(
        StackScenes(split="val", limit=2), Blocks(strength),
        RandomViewpoints(width=80, height=60), SphereTracer(), Projective(), **settings,
    )  # fmt: skip


def test_codes_that_say_nothing_have_no_variety():
    result = evaluation(0).run()
    figures = result.figures
    for count in (1, 2):
        assert figures[f"views/{count}/ratio"] == 0
        assert figures[f"views/{count}/among"] == 0
        assert figures[f"views/{count}/to_truth"] == figures[f"views/{count}/zero_to_truth"] > 0.3
    assert "codes/length" not in figures  # both ends are one
    assert latent_space_sections(result)


def test_codes_that_say_the_height_vary_as_it_does():
    """Blocks of heights a and b have the IoU min / max."""
    one = evaluation(3)
    scores = one.score(0)
    seen = one.see(0)
    drawn = [int((scene.tsdf[0, 7, 7] < 0).sum()) for scene in one.completions(seen, 1)[1:]]
    pairs = [(a, b) for i, a in enumerate(drawn) for b in drawn[i + 1 :]]
    expected = np.mean([1 - min(pair) / max(pair) for pair in pairs])
    assert scores.variety[1]["among"] == pytest.approx(expected)
    assert scores.variety[2]["among"] == pytest.approx(expected)  # they don't look at the view
    assert scores.variety[1]["instances_among"] == pytest.approx(expected)
    assert scores.ways["codes"]["fewest"] == scores.ways["codes"]["most"] == 2
    assert scores.ways["blended"]["length"] >= 1 - 1e-9


def test_the_way_between_codes_stays_as_far_out_as_they_are():
    first, last = torch.tensor([[3.0, 0, 0, 0]]), torch.tensor([[0, 3.0, 0, 0]])
    for share in (0.0, 0.25, 0.5, 1.0):
        code = on_sphere(first, last, share)
        angle = np.pi / 2 * share
        expected = [3 * np.cos(angle), 3 * np.sin(angle), 0, 0]
        np.testing.assert_allclose(code[0], expected, atol=1e-5)
    np.testing.assert_allclose(on_sphere(first, first, 0.3), first, atol=1e-2)


def test_an_interrupted_evaluation_goes_on_where_it_was(tmp_path):
    def stop(item):
        raise KeyboardInterrupt

    whole = evaluation(3)
    expected = whole.run()
    part = evaluation(3, kept=KeptRows(tmp_path))
    score = part.score
    part.score = lambda row: score(row) if row == 0 else stop(row)
    with pytest.raises(KeyboardInterrupt):
        part.run()
    again = evaluation(3, kept=KeptRows(tmp_path))
    assert again.run().figures == expected.figures
    assert again.network.calls < whole.network.calls


@pytest.mark.exhaustive
def test_pictures_are_drawn(tmp_path):
    pictures = LatentSpaceGallery(evaluation(3), tmp_path, count=1).show()
    assert len(pictures) == 2
    assert all((tmp_path / picture.path).is_file() for picture in pictures)


def test_bad_settings_are_one_line():
    with pytest.raises(ConfigError, match="at least 1, 2 and 2"):
        evaluation(1, samples=1)
    with pytest.raises(ConfigError, match="at least 1, 2 and 2"):
        evaluation(1, counts=())
    blank = Blocks(1)
    blank.model = SimpleNamespace(latent_size=0)
    with pytest.raises(ConfigError, match="no codes"):
        LatentSpaceEvaluation(None, blank, None, None, None)
    with pytest.raises(ConfigError, match="at least 1"):
        LatentSpaceGallery(evaluation(1), "out", count=0)
