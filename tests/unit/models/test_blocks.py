import numpy as np
import pytest
import torch

from scenefw.models.blocks import (
    Conv3d,
    ResidualBlock,
    SqueezeExcitation,
    depth_to_space,
    space_to_depth,
)


@pytest.mark.parametrize("factor", [2, 4])
def test_blocks_become_channels_and_back(factor):
    volume = torch.arange(2 * 3 * 8**3, dtype=torch.float32).reshape(2, 3, 8, 8, 8)
    blocks = space_to_depth(volume, factor)
    assert blocks.shape == (2, 3 * factor**3, *(8 // factor,) * 3)
    np.testing.assert_array_equal(
        blocks[1, factor**3 : 2 * factor**3, 1, 0, 1],
        volume[1, 1, factor : 2 * factor, :factor, factor : 2 * factor].flatten(),
    )
    assert torch.equal(depth_to_space(blocks, factor), volume)


def test_squeeze_and_excitation_scales_whole_channels():
    torch.manual_seed(0)
    features = torch.rand(2, 8, 3, 3, 3) + 0.1
    ratio = SqueezeExcitation(8)(features) / features
    assert float(ratio.flatten(2).std(dim=2).max()) < 1e-6
    assert float(ratio.min()) > 0
    assert float(ratio.max()) < 1


def test_residual_block_without_a_body_is_its_activation():
    torch.manual_seed(0)
    block = ResidualBlock(8).eval()
    torch.nn.init.zeros_(block.body[1].weight)
    features = torch.randn(1, 8, 2, 2, 2)
    expected = torch.nn.functional.prelu(features, block.activation.weight)
    np.testing.assert_allclose(block(features).detach(), expected.detach(), atol=1e-6)


def test_tiny_volumes_keep_float32_in_mixed_precision_on_the_cpu():
    torch.manual_seed(0)
    layer = Conv3d(4, 4, 3, padding=1)
    tiny, larger = torch.rand(2, 4, 2, 2, 2), torch.rand(2, 4, 4, 4, 4)
    expected = layer(tiny)
    with torch.autocast("cpu", torch.bfloat16):
        assert torch.equal(layer(tiny), expected)
        assert torch.equal(layer(tiny.bfloat16()), layer(tiny.bfloat16().float()))
        assert layer(larger).dtype == torch.bfloat16
