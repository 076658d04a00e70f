"""Where images of objects end, beside a loop over pixels."""

import numpy as np
import pytest
import torch
from tests.unit.data.stacks_file import write_stacks

from scenefw.core.batches import IndexBatch
from scenefw.data.batches.object_ends import object_ends
from scenefw.data.batches.set_flow import SetFlowViews
from scenefw.scenes.cameras import RandomViewpoints


def image(width, height):
    """A box before a wall, hidden on the right by a nearer one; some pixels are unknown.

    Parts of both reach beyond the image, where no end of theirs is seen.
    """
    v, u = np.mgrid[:height, :width] / (height, width)[0]
    owners = np.zeros((height, width), np.int64)
    owners[(v > 0.3) & (v < 0.7) & (u > 0.3) & (u < 0.8)] = 1
    owners[(v > 0.2) & (v < 0.8) & (u > 0.6) & (u < 0.9)] = 3
    owners[(v > 0.9) & (u > 1.0)] = 1
    owners[(v < 0.1) & (u < 0.2)] = 3
    reach = np.choose(owners, [1.2, 0.8, 0.0, 0.6])
    rays = np.stack([u - 0.6, 0.5 - v, np.full_like(u, -1.0)], axis=-1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    eye = np.array([0.1, -0.2, 1.3])
    points = eye + reach[..., None] * rays
    points[height // 2, : width // 2] = np.nan
    return points.astype(np.float32), owners, eye.astype(np.float32)


def ends_by_a_loop(points, owners, eye):
    """All ends of each object, pixel by pixel."""
    found = {1: [], 2: [], 3: []}
    height, width = owners.shape
    for row in range(height):
        for column in range(width):
            own = owners[row, column]
            for down, right in ((0, 1), (0, -1), (1, 0), (-1, 0)):
                y, x = row + down, column + right
                if own == 0 or not (0 <= y < height and 0 <= x < width) or owners[y, x] == own:
                    continue
                here, there = points[row, column] - eye, points[y, x] - eye
                if np.isnan([here, there]).any():
                    continue
                ray = here / np.linalg.norm(here)
                out = np.cross(np.cross(ray, there), ray)  # at right angles to the ray
                further = min(np.linalg.norm(there) - np.linalg.norm(here), 0.5)
                out /= np.linalg.norm(out)
                found[own].append([*points[row, column], *out, further])
    return {own: np.array(rows) for own, rows in found.items()}


@pytest.mark.parametrize("size", [(40, 30), (64, 48)])
def test_ends_are_those_that_a_loop_finds(size):
    points, owners, eye = image(*size)
    expected = ends_by_a_loop(points, owners, eye)
    count = 4 * max(len(rows) for rows in expected.values())
    chances = (torch.arange(count) + 0.5).div(count).expand(2, 3, -1)
    both = [torch.from_numpy(np.stack([one, one])) for one in (points, owners, eye)]
    found = object_ends(*both, chances)
    assert torch.equal(found[0], found[1])
    assert not found[0, 1].any()  # nothing is seen of the second
    for own in (1, 3):
        rows = np.unique(found[0, own - 1].numpy().round(4), axis=0)
        wanted = np.unique(expected[own].round(4), axis=0)
        assert len(rows) == len(wanted)
        assert np.allclose(rows, wanted, atol=2e-4)
    further = found[0, 0, :, 6]
    assert {round(float(one), 2) for one in further.unique()} == {-0.2, 0.4}


def test_of_an_image_without_objects_there_are_none():
    points = torch.ones(1, 4, 6, 3)
    nothing = torch.zeros(1, 4, 6, dtype=torch.int64)
    assert not object_ends(points, nothing, torch.zeros(1, 3), torch.rand(1, 2, 5)).any()


def test_ends_in_training_lie_on_objects_and_point_out_of_them(tmp_path):
    write_stacks(tmp_path / "stacks.npz")
    data = SetFlowViews(
        RandomViewpoints(), str(tmp_path / "stacks.npz"), validation_limit=2, batch_size=4,
        image_size=(96, 72), points=64, ends=32, along=0.0,
    )  # fmt: skip
    batch = data.training_batch(IndexBatch(0, torch.arange(6)), torch.device("cpu"))
    place, outward, further = (one[batch.seen] for one in batch.ends.split([3, 3, 1], dim=-1))
    assert not batch.ends[~batch.seen].any()
    middle = batch.points.mean(dim=2)[batch.seen][:, None]
    assert ((place - middle) * outward).sum(dim=-1).mean() > 0.01
    local = torch.einsum(
        "nji,npj->npi", batch.rotations[batch.seen], place - batch.positions[batch.seen][:, None]
    )
    ratio = local.abs() / batch.half_axes[batch.seen][:, None]
    value = (ratio ** batch.exponents[batch.seen][:, None]).sum(dim=-1)
    assert (value - 1).abs().max() < 0.02
    assert (further > 0.005).any()
