"""Methods on more and more views of a scene."""

import pytest
import torch

from scenefw.core.batches import Completion
from scenefw.core.types import GridSpec
from scenefw.data.batches.stacks import StackScenes, shipped_scenes
from scenefw.evaluation.stacks.surface_scores import SurfaceScoring
from scenefw.mapping.projective import Projective
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw.scenes.cameras import RandomViewpoints
from scenefw_several_views.evaluation import SeveralViewsEvaluation

pytestmark = pytest.mark.skipif(not shipped_scenes().exists(), reason="no shipped data set")


class Coin:
    """Free space or noise, as the generator says."""

    grid = None

    def complete_views(self, views, grid, samples, generator):
        fields = torch.randn(samples, 1, *grid.shape, generator=generator)
        return [Completion(field * grid.voxel_size, (field < 0).int()) for field in fields]


def scores(methods, counts=(1, 2)):
    return SeveralViewsEvaluation(
        StackScenes(split="test", limit=1),
        methods,
        RandomViewpoints(width=80, height=60),
        SphereTracer(),
        Projective(),
        grid=GridSpec(resolution=16),
        counts=counts,
        surfaces=SurfaceScoring(dense_points=2000),
    ).score(0)


def test_figures_of_a_method_do_not_depend_on_others_nor_on_further_numbers_of_views():
    alone = scores({"coin": Coin()})
    beside = scores({"other": Coin(), "coin": Coin()})
    assert alone.scores["coin"] == beside.scores["coin"]
    fewer = scores({"coin": Coin()}, counts=(2,))
    assert fewer.scores["coin"][2] == alone.scores["coin"][2]
    assert alone.scores["coin"][1] != alone.scores["coin"][2]  # other points of the same scenes
