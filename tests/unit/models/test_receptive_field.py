import numpy as np
import pytest
import torch
from torch import nn

from scenefw.core.errors import InputError
from scenefw.learning.checkpoint import load_checkpoint
from scenefw.models.fusenet import FuseNet, FuseNetBody
from scenefw.models.receptive_field import receptive_field

SIZE, MIDDLE = 160, 80


def footprint(network, inputs, axis, pixel):
    """First and last input pixel with a gradient, relative to the output pixel."""
    images = [torch.rand(1, c, SIZE, SIZE, dtype=torch.float64, requires_grad=True) for c in inputs]
    at = (0, 0, pixel, MIDDLE) if axis == 0 else (0, 0, MIDDLE, pixel)
    gradients = torch.autograd.grad(network(*images)[at], images)
    touched = sum(g.abs().sum(dim=(0, 1, 3 - axis)) for g in gradients).nonzero()
    return int(touched[0]), int(touched[-1])


def prepared(network):
    """Positive weights let every path through every ReLU."""
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.abs_().add_(0.01)
    return network.double().eval()


@pytest.mark.parametrize(("modules", "block"), [((1, 2, 2, 3), 1), ((2, 1, 1), 1), ((1, 1, 1), 2)])
@pytest.mark.parametrize("axis", [0, 1])
def test_it_is_the_footprint_of_the_gradient(modules, block, axis):
    network = prepared(FuseNetBody(2, (2,) * len(modules), modules, 0.0, block))
    field = receptive_field(network, axis)
    found = np.array(
        [
            np.subtract(footprint(network, (3, 2), axis, pixel), pixel)
            for pixel in range(MIDDLE, MIDDLE + field.period)
        ]
    )
    assert found[:, 0].min() == -field.before  # reached at one phase, never passed at another
    assert found[:, 1].max() == field.after
    assert field.size >= (found[:, 1] - found[:, 0]).max() + 1


def test_the_network_of_the_thesis_comes_near_it():
    field = receptive_field(FuseNet(4, (16, 24, 48, 80), (1, 2, 2, 3)).body)
    assert field.size == 96  # thesis: 91
    assert (field.stride, field.period, field.margin) == (1, 8, 56)


@pytest.mark.parametrize("name", ["label_views", "label_maps"])
def test_shipped_networks_see_as_far_as_the_document_says(name):
    """Of `fusenet_blocks`; `docs/labelling.md` has these numbers."""
    network = load_checkpoint(None, task="segmentation", shipped=name).model
    field = receptive_field(network.body)
    assert (field.before, field.after, field.size) == (183, 153, 337)
    assert (network.stride, network.margin) == (32, 192)


def test_known_layers():
    """VGG-like: 3x3, 3x3, pool 2, 5x5 dilated by 2: 1 + 2 + 2 + 1 + 2 * 8."""
    layers = nn.Sequential(
        nn.Conv2d(1, 1, 3, padding=1),
        nn.PReLU(),
        nn.Conv2d(1, 1, 3),
        nn.MaxPool2d(2),
        nn.BatchNorm2d(1),
        nn.Conv2d(1, 1, 5, dilation=2),
        nn.Dropout(),
    )
    field = receptive_field(layers)
    assert field.size == 22
    assert field.stride == 2


def test_kernels_that_are_not_square_differ_by_axis():
    layers = nn.Conv2d(1, 1, (3, 7), stride=(1, 2))
    assert [receptive_field(nn.Sequential(layers), axis).size for axis in (0, 1)] == [3, 7]


def test_a_transposed_convolution_has_its_footprint():
    layers = nn.Sequential(
        nn.Conv2d(1, 1, 3, 2, 1), nn.ConvTranspose2d(1, 1, 4, 2, 1), nn.Conv2d(1, 1, 3, padding=1)
    )
    field = receptive_field(layers)
    found = [np.subtract(footprint(prepared(layers), (1,), 0, p), p) for p in (80, 81)]
    assert min(f[0] for f in found) == -field.before
    assert max(f[1] for f in found) == field.after


@pytest.mark.parametrize("layer", [nn.Upsample(scale_factor=2, mode="bilinear"), nn.Softmax()])
def test_an_unknown_layer_is_one_line(layer):
    with pytest.raises(InputError, match="unknown") as caught:
        receptive_field(nn.Sequential(nn.Conv2d(1, 1, 3), layer))
    assert "\n" not in str(caught.value)


def test_one_level_more_sees_almost_twice_as_far():
    shallow = receptive_field(FuseNet(4, (16, 24, 48, 80), (1, 2, 2, 3)).body).size
    deep = FuseNet(4, widths=(16, 24, 48, 80, 112), modules=(1, 2, 2, 3, 2))
    assert 1.8 * shallow < receptive_field(deep.body).size < 2.2 * shallow
