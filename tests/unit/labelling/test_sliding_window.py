import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from scenefw.contracts import problems
from scenefw.core.errors import ConfigError
from scenefw.core.training_protocols import SegmentationModel
from scenefw.labelling import sliding_window
from scenefw.labelling.sliding_window import SlidingWindow, bytes_per_pixel, free_megabytes, windows
from scenefw.models.fusenet import FuseNet


@pytest.fixture(scope="module")
def network():
    torch.manual_seed(0)
    network = FuseNet(3, (4, 4, 6, 6), (1, 2, 2, 3)).train()
    with torch.no_grad():
        for _ in range(2):  # statistics that are not 0 and 1
            network(*(image[None] for image in images(48, 64)))
    return network.eval()


def images(height, width):
    generator = torch.Generator().manual_seed(height)
    colour = torch.rand(3, height, width, generator=generator)
    distance = 0.3 * torch.rand(1, height, width, generator=generator)
    distance[:, height // 3 : height // 2, : width // 4] = torch.nan
    return colour, distance


@pytest.mark.parametrize("size", [(520, 513), (300, 437)])
@pytest.mark.parametrize("options", [{"window": 250}, {"memory": 25.0}])
def test_it_equals_one_pass(network, size, options):
    colour, distance = images(*size)
    with torch.no_grad():
        whole = network(colour[None], distance[None])[0].softmax(dim=0)
    found = SlidingWindow(**options).probabilities(network, colour, distance)
    assert float((found - whole).abs().max()) < 1e-4


class Plain(torch.nn.Module):
    """A network that is no FuseNet: what `SegmentationModel` says, and nothing more."""

    training_only, recipe, classes = (), {}, 3

    def __init__(self, kernel):
        super().__init__()
        torch.manual_seed(1)
        self.stride, self.margin = 1, kernel // 2
        self.layer = torch.nn.Conv2d(4, self.classes, kernel, padding=kernel // 2)

    def forward(self, colour, distance):
        return self.layer(torch.cat([colour, distance.nan_to_num()], dim=1))


@pytest.mark.parametrize("kernel", [1, 5])
def test_any_network_that_says_how_far_it_looks_is_taken(kernel):
    network, (colour, distance) = Plain(kernel), images(70, 90)
    assert not list(problems(Plain, SegmentationModel))
    with torch.no_grad():
        whole = network(colour[None], distance[None])[0].softmax(dim=0)
    found = SlidingWindow(window=16).probabilities(network, colour, distance)
    torch.testing.assert_close(found, whole)


def test_a_window_must_begin_at_the_stride(network):
    """What the alignment is for: the same margins from an odd place give other labels."""
    colour, distance = images(260, 260)
    with torch.no_grad():
        whole = network(colour[None], distance[None])[0]
        part = network(colour[None, :, 3:, 3:], distance[None, :, 3:, 3:])[0]
    assert float((whole[:, 70:, 70:] - part[:, 67:, 67:]).abs().max()) > 1e-3


@given(st.integers(1, 700), st.integers(0, 5), st.integers(1, 40))
def test_windows_cover_a_line_once(size, margin, extra):
    margin, side = 8 * margin, 16 * margin + 8 * extra
    kept, found = np.zeros(size, int), list(windows(size, side, margin))
    for window in found:
        kept[window.begin : window.end] += 1
        assert window.first % 8 == 0
        assert window.last - window.first <= side
        assert window.first == 0 or window.begin - window.first >= margin
        assert window.last == size or window.last - window.end >= margin
    assert (kept == 1).all()


def test_inner_windows_lie_apart_by_eq_4_11():
    begins = [w.begin for w in windows(1025, 256, 56)]
    assert set(np.diff(begins[1:])) == {256 - 2 * 56}


def test_more_memory_gives_larger_windows(network):
    cpu = torch.device("cpu")
    small, large = (SlidingWindow(memory)._side(network, 56, cpu) for memory in (20.0, 80.0))
    assert large == pytest.approx(2 * small, abs=2 * 8)
    assert large % 8 == small % 8 == 0
    assert large**2 * bytes_per_pixel(network) <= 80e6
    assert SlidingWindow(1e-3)._side(network, 56, cpu) == 4 * 56


def test_labels_are_the_same_whatever_memory_is_free(network, monkeypatch):
    colour, distance = images(1025, 1025)
    seen = []
    hook = network.register_forward_pre_hook(lambda _, inputs: seen.append(inputs[0].shape[-1]))

    def found(free):
        seen.clear()
        monkeypatch.setattr(sliding_window, "available_memory", lambda: free)
        result = SlidingWindow().probabilities(network, colour, distance)
        return result, max(seen)

    monkeypatch.setattr(sliding_window, "LEAST", 16)
    (scarce, narrow), (plenty, wide) = found(120e6), found(64e9)
    hook.remove()
    assert narrow < 500
    assert wide == 1025
    assert float((scarce - plenty).abs().max()) < 1e-5


@pytest.mark.parametrize(
    ("free", "expected"),
    [(0, 128), (600e6, 128), (2.5e9, 512), (5e9, 1024), (8.2e9, 2048), (1e12, 4096), (None, 512)],
)
def test_a_quarter_of_what_is_free_is_taken(monkeypatch, free, expected):
    monkeypatch.setattr(sliding_window, "available_memory", lambda: free)
    assert free_megabytes(torch.device("cpu")) == expected


def test_on_a_gpu_its_own_memory_counts(monkeypatch):
    gpu = torch.device("cuda")
    monkeypatch.setattr(sliding_window, "available_memory", lambda: 64e9)
    monkeypatch.setattr(torch.cuda, "mem_get_info", lambda _: (1e9, 8e9))
    monkeypatch.setattr(torch.cuda, "memory_reserved", lambda _: 4e9)
    monkeypatch.setattr(torch.cuda, "memory_allocated", lambda _: 0.5e9)
    assert free_megabytes(gpu) == 1024  # a quarter of 4.5 GB, rounded down
    assert free_megabytes(torch.device("meta")) == 512  # nobody knows


@pytest.mark.skipif(not torch.cuda.is_available(), reason="there is no GPU")
def test_free_memory_of_a_gpu():
    held = torch.cuda.mem_get_info()[1]
    assert 128 <= free_megabytes(torch.device("cuda")) <= max(128, held / 4e6)


def test_wrong_settings_are_refused():
    with pytest.raises(ConfigError, match="memory = 0"):
        SlidingWindow(memory=0)
    with pytest.raises(ConfigError, match="window = 0"):
        SlidingWindow(window=0)
