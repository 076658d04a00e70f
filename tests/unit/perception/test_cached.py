import torch

from scenefw.core.batches import Completion, PartialTSDF
from scenefw.core.types import GridSpec
from scenefw.perception.cached import Remembered

GRID = GridSpec(resolution=4)


class Drawing:
    """Draws all of its scenes, and counts how often it is asked."""

    grid, metadata = GRID, {"made": "by hand"}

    def __init__(self):
        self.asked = 0

    def complete(self, partial, grid, samples, generator):
        self.asked += 1
        fields = torch.randn(samples, 1, *grid.shape, generator=generator)
        return [Completion(field, (field < 0).int()) for field in fields]


def view():
    volume = torch.zeros(1, 1, *GRID.shape)
    return PartialTSDF(volume, volume > 0)


def seeded(seed=0):
    return torch.Generator().manual_seed(seed)


def test_the_same_question_is_answered_once_and_leaves_the_generator_alike():
    inner, partial = Drawing(), view()
    method, generators = Remembered(inner), [seeded(), seeded()]
    first, again = (method.complete(partial, GRID, 3, one) for one in generators)
    assert inner.asked == 1
    assert all(a is b for a, b in zip(first, again, strict=True))
    assert torch.equal(*(torch.randn(5, generator=one) for one in generators))
    assert method.metadata == inner.metadata


def test_another_question_is_asked_anew():
    inner, partial = Drawing(), view()
    method = Remembered(inner)
    method.complete(partial, GRID, 3, seeded())
    method.complete(view(), GRID, 3, seeded())  # equal, but another view
    method.complete(partial, GRID, 3, seeded())
    method.complete(partial, GRID, 2, seeded())
    method.complete(partial, GRID, 2, seeded(1))
    assert inner.asked == 5
