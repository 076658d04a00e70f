import pytest
import torch
from tests.unit.models.sets import boxes
from torch.nn import functional

from scenefw import registry
from scenefw.core.errors import ConfigError, InputError
from scenefw.models.placed_head import Boxes
from scenefw.models.placed_shapes import placed, places_of
from scenefw.models.set_placed import PlacedSetAutoencoder

SMALL = {"encoder_widths": (8, 6, 4), "decoder_widths": (8, 4), "code_size": 8, "side": 4}


def drawn(*shape, seed=0, scale=1.0, dtype=torch.float32):
    return scale * torch.randn(shape, generator=torch.Generator().manual_seed(seed), dtype=dtype)


def some_boxes(scenes, slots, dtype=torch.float32):
    centres = drawn(scenes, slots, 3, seed=1, scale=0.3, dtype=dtype)
    halves = 0.3 + drawn(scenes, slots, 3, seed=2, scale=0.05, dtype=dtype)
    return torch.stack([centres, halves], dim=-2)


@pytest.mark.parametrize("resolution", [12, 32])
def test_placing_is_linear_interpolation(resolution):
    """Beside torch's own, of a volume with a margin of what stands for nothing."""
    shapes, where = drawn(2, 3, 8, 8, 8), some_boxes(2, 3)
    padded = functional.pad(shapes, (4,) * 6, value=-10.0)  # sides of 16, twice as long
    axis = (torch.arange(resolution) + 0.5) * (2 / resolution) - 1
    points = torch.stack(torch.meshgrid(axis, axis, axis, indexing="ij"), dim=-1)
    found = placed(shapes, where, resolution)
    for scene in range(2):
        for slot in range(3):
            centre, half = where[scene, slot]
            inside = (points - centre) / (2 * 1.25 * half)
            expected = functional.grid_sample(
                padded[scene, slot][None, None],
                inside.flip(-1)[None],
                align_corners=False,
                padding_mode="border",
            )
            torch.testing.assert_close(found[scene, slot], expected[0, 0], rtol=1e-4, atol=1e-4)


def test_gradients_of_places_and_sizes_are_right():
    shapes = drawn(1, 1, 4, 4, 4, dtype=torch.float64).requires_grad_()
    where = some_boxes(1, 1, dtype=torch.float64).requires_grad_()
    assert torch.autograd.gradcheck(lambda a, b: placed(a, b, 6), (shapes, where))


def test_an_object_is_moved_by_its_box_and_looks_the_same():
    shapes, where = drawn(1, 1, 8, 8, 8), some_boxes(1, 1)
    voxel = 2 / 32
    moved = where.clone()
    moved[..., 0, :] += torch.tensor([3 * voxel, -2 * voxel, voxel])
    first, second = placed(shapes, where, 32), placed(shapes, moved, 32)
    torch.testing.assert_close(
        first.roll((3, -2, 1), dims=(2, 3, 4))[..., 6:-6, 6:-6, 6:-6],
        second[..., 6:-6, 6:-6, 6:-6],
        rtol=1e-4,
        atol=1e-4,
    )


def test_boxes_begin_in_their_cells():
    cells = torch.tensor([[0, 5, 63]])
    middles = places_of(cells, 4)
    assert middles[0, 0].tolist() == [-0.75] * 3
    assert middles[0, 1].tolist() == [-0.75, -0.25, -0.25]
    found = Boxes(6, 4)(drawn(1, 3, 6), cells)
    assert (found[..., 0, :] - middles).abs().max() < 0.05
    assert found[..., 1, :].min() > 0.1
    assert found[..., 1, :].max() < 0.15


@pytest.mark.parametrize(("resolution", "seen"), [(16, None), (32, None), (32, 16)])
def test_any_resolution_gives_objects_of_its_size(resolution, seen):
    torch.manual_seed(0)
    model = PlacedSetAutoencoder(resolution, 3, seen_resolution=seen, **SMALL)
    prediction = model(boxes(resolution))
    assert prediction.logits.shape == (2, 3, *(resolution,) * 3)
    assert prediction.features.shape == (2, 8, 4, 4, 4)
    assert prediction.boxes.shape == (2, 3, 2, 3)
    assert torch.equal(prediction.centres, prediction.boxes[..., 0, :])
    assert prediction.existence.shape == (2, 3)
    assert prediction.logits.median() < -9  # outside the boxes


@torch.no_grad()
def test_coarse_weights_go_on_with_a_finer_grid():
    """What is seen of blocks of equal voxels is the same, so codes and boxes are."""
    torch.manual_seed(0)
    coarse = PlacedSetAutoencoder(16, 3, **SMALL).eval()
    fine = PlacedSetAutoencoder(32, 3, seen_resolution=16, **SMALL).eval()
    fine.load_state_dict(coarse.state_dict())
    occupancy = boxes(16).occupancy
    doubled = occupancy.repeat_interleave(2, 2).repeat_interleave(2, 3).repeat_interleave(2, 4)
    first, second = coarse.decompose(occupancy), fine.decompose(doubled)
    torch.testing.assert_close(first.codes, second.codes)
    torch.testing.assert_close(first.boxes, second.boxes)
    assert second.logits.shape[-1] == 32


def test_it_sees_what_it_is_said_to_see():
    batch, other = boxes(seed=0), boxes(seed=1)
    torch.manual_seed(0)
    model = PlacedSetAutoencoder(16, 3, "view", **SMALL).eval()
    moved = type(batch)(other.condition, batch.instances, batch.present, batch.centres)
    hidden = type(batch)(batch.condition, other.instances, batch.present, batch.centres)
    with torch.no_grad():
        first = model(batch).logits
        assert not torch.equal(first, model(moved).logits)
        assert torch.equal(first, model(hidden).logits)


def test_the_shipped_option_is_no_larger_than_the_thesiss():
    model = registry.build("model", "set_placed", resolution=64)
    assert sum(p.numel() for p in model.parameters()) < 2.6e6
    again = registry.build("model", "set_placed", resolution=64, attention=False)
    assert again.head.attention is None


def test_wrong_sizes_are_one_line():
    with pytest.raises(ConfigError, match=r"model\.seen_resolution is 24"):
        PlacedSetAutoencoder(64, seen_resolution=24)
    with pytest.raises(ConfigError, match=r"model\.decoder_widths is \[\]"):
        PlacedSetAutoencoder(64, decoder_widths=())
    with pytest.raises(ConfigError, match=r"model\.slots is 70"):
        PlacedSetAutoencoder(16, 70, side=4)
    with pytest.raises(ConfigError, match=r"model\.sees is 'depth'"):
        PlacedSetAutoencoder(16, sees="depth")
    with pytest.raises(InputError, match=r"\(B, 1, 16, 16, 16\)"):
        PlacedSetAutoencoder(16, side=4).decompose(torch.zeros(1, 2, 16, 16, 16))
