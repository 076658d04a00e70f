"""Examples: repeatable, on the method's own grid, labels as in truth."""

import numpy as np
import pytest
import torch

from scenefw.core.batches import Completion, SceneParameters
from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, GridSpec
from scenefw.evaluation.stacks.examples import Examples
from scenefw.mapping.projective import Projective
from scenefw.renderers.sphere_tracer import SphereTracer


class _Viewpoints:
    def sample(self, rng):
        x, y = rng.uniform(0.5, 0.8, 2)
        pose = look_at((x, -y, 0.5), (0.0, 0.0, 0.1))
        return Camera(32, 24, 30.0, 30.0, 15.5, 11.5, pose)


class _Method:
    grid = GridSpec(16)

    def complete(self, partial, grid, samples, generator):
        assert grid == self.grid
        noise = torch.rand(1, generator=generator)
        tsdf = partial.distance[:, 0] + 0 * noise
        moved = [tsdf + 0.01 * i for i in range(samples)]
        return [Completion(each, (each < 0).to(torch.int32)) for each in moved]


@pytest.fixture
def scenes():
    class _Scenes:
        indices = np.arange(100, 110)

        def __len__(self):
            return 10

        def parameters(self, rows, device="cpu"):
            size = torch.tensor([0.05 + 0.005 * rows[0]])
            return SceneParameters(
                size.repeat(3).view(1, 1, 3),
                torch.full((1, 1, 3), 2.0),
                torch.eye(3).view(1, 1, 3, 3),
                torch.tensor([[[0.0, 0.0, float(size)]]]),
                torch.ones(1, 1, dtype=torch.bool),
            )

    return _Scenes()


def test_examples_are_spread_and_repeatable(scenes):
    def make(count):
        return Examples(scenes, _Method(), _Viewpoints(), SphereTracer(), Projective(), count=count)

    two, again = make(2).make(), make(2).make()
    assert [example.name for example in two] == ["scene 100", "scene 109"]
    assert all(np.array_equal(a.depth, b.depth) for a, b in zip(two, again, strict=True))
    first = make(3).make()[0]
    assert np.array_equal(first.depth, two[0].depth)  # however many are made
    assert two[0].tsdf.shape == two[0].true_instances.shape == (16, 16, 16)
    assert (two[0].depth > 0).any()


def test_further_samples_follow_the_first(scenes):
    def make(samples):
        parts = (scenes, _Method(), _Viewpoints(), SphereTracer(), Projective())
        return Examples(*parts, count=1, samples=samples).make()[0]

    one, three = make(1), make(3)
    assert one.further_samples == ()
    assert np.array_equal(one.tsdf, three.tsdf)
    for i, (tsdf, instances) in enumerate(three.further_samples, start=1):
        np.testing.assert_allclose(tsdf, one.tsdf + 0.01 * i, atol=1e-6)
        assert ((instances > 0) == (tsdf < 0)).all()
