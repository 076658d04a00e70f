"""Training of affinities: it learns, and the weights that ship tell borders from insides."""

from types import SimpleNamespace

import pytest
import torch

from scenefw import registry
from scenefw.core.batches import IndexBatch
from scenefw.core.errors import ConfigError
from scenefw.core.types import GridSpec
from scenefw.data.batches.part_views import PartViews
from scenefw.learning.checkpoint import load_checkpoint
from scenefw.learning.part_affinity import PartAffinityLearning
from scenefw.losses.part_affinity import PartAffinityCrossEntropy, true_affinities
from scenefw.losses.part_shown import PartShownCrossEntropy
from scenefw.models.part_affinity import PartAffinity
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw.scenes.cameras import RandomViewpoints

CPU = torch.device("cpu")


def images(size, traced=0.5):
    """Four validation scenes."""
    data = PartViews(
        RandomViewpoints(), SphereTracer(), GridSpec(64), "stacks_v2",
        validation_limit=4, image_size=size, traced=traced,
        compound=0.0, ends=0.0, tilt=0.0, lift=0.0,
    )  # fmt: skip
    return data.validation_batch(IndexBatch(0, torch.arange(4)), CPU)


@torch.no_grad()
def right(network, batch):
    """Shares of insides and of borders that are told right: a constant has 1 and 0, or 0 and 1."""
    same, counts = true_affinities(batch.owners)
    said = network.eval()(batch.depth, batch.cameras)[:, :2] > 0
    return [float((said == same)[counts & which].float().mean()) for which in (same, ~same)]


def test_shipped_weights_tell_borders_from_insides():
    batch = images((320, 240), 1.0)
    network = load_checkpoint("part_affinity", task="part_affinity").model
    assert min(right(network, batch)) > 0.85
    torch.manual_seed(0)
    assert min(right(registry.build("model", "part_affinity"), batch)) < 0.6


def test_it_learns_one_batch_by_heart():
    torch.manual_seed(0)
    batch, loss = images((80, 60), 0.0), PartAffinityCrossEntropy()
    network = PartAffinity(widths=(8, 12, 16), shown=False)
    optimiser = torch.optim.AdamW(network.parameters(), 1e-2)
    costs = []
    for _ in range(60):
        costs.append(loss(network(batch.depth, batch.cameras), batch))
        optimiser.zero_grad()
        costs[-1].backward()
        optimiser.step()
    assert float(costs[-1].detach()) < 0.3 * float(costs[0].detach())


def test_a_network_of_shown_pixels_needs_a_loss_that_teaches_it():
    alone = {"part_affinity": PartAffinityCrossEntropy()}
    both = {**alone, "part_shown": PartShownCrossEntropy(1.0)}
    data = SimpleNamespace(image_size=(32, 24))
    network = PartAffinity((4, 8), shown=True)
    assert PartAffinityLearning(network, both, 1e-3).setup_with(data).shown
    with pytest.raises(ConfigError, match="no loss teaches"):
        PartAffinityLearning(network, alone, 1e-3).setup_with(data)
    blind = PartAffinity((4, 8), shown=False)
    assert not PartAffinityLearning(blind, alone, 1e-3).setup_with(data).shown
