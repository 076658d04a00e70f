"""Objects that become cups, or get a second piece."""

import numpy as np
import torch

from scenefw.core.batches import SceneParameters
from scenefw.core.rng import Streams
from scenefw.data.batches.compounds import compounds
from scenefw.shapes.superquadric import Superquadric


def scenes(count=40):
    rng = np.random.default_rng(3)
    turns = np.linalg.qr(rng.normal(size=(count, 2, 3, 3)))[0]
    turns *= np.sign(np.linalg.det(turns))[..., None, None]
    arrays = (
        rng.uniform(0.02, 0.1, (count, 2, 3)), rng.uniform(2, 30, (count, 2, 3)), turns,
        rng.uniform(-0.2, 0.2, (count, 2, 3)),
    )  # fmt: skip
    tensors = [torch.from_numpy(one.astype(np.float32)) for one in arrays]
    return SceneParameters(*tensors, torch.ones(count, 2, dtype=torch.bool))


def made(hollow=1.0, pieces=1.0, changed=None, given=None):
    given = given or scenes()
    count = len(given.present)
    changed = np.ones(count, bool) if changed is None else changed
    return compounds(given, Streams.of(0, indices=np.arange(count)), changed, hollow, pieces)


def inside(solids, scene, slot, points):
    local = (points - solids.positions[scene, slot].numpy()) @ solids.rotations[scene, slot].numpy()
    shape = Superquadric(
        solids.half_axes[scene, slot].double().numpy(),
        solids.exponents[scene, slot].double().numpy(),
    )
    return shape.value(local) < 1


def places(solids, scene, slot, count=4000):
    rng = np.random.default_rng(scene)
    reach = 1.6 * solids.half_axes[scene, slot].numpy()
    local = rng.uniform(-reach, reach, (count, 3))
    return local @ solids.rotations[scene, slot].numpy().T + solids.positions[scene, slot].numpy()


def test_holes_open_at_one_side_and_leave_walls():
    solids, holes = made()
    assert holes.present[:, :2].all()
    assert not holes.present[:, 2:].any()
    for scene in range(40):
        points = places(solids, scene, 0)
        whole, cut = inside(solids, scene, 0, points), inside(holes, scene, 0, points)
        assert (whole & cut).mean() > 0.2 * whole.mean()  # room in it
        assert (whole & ~cut).mean() > 0.05 * whole.mean()  # walls
        assert (cut & ~whole).any()  # an opening


def test_most_holes_open_upward():
    solids, holes = made()
    moved = holes.positions[:, :2] - solids.positions[:, :2]
    assert (moved[..., 2] > 0).float().mean() > 0.75


def test_second_pieces_go_through_the_surface():
    solids, _ = made()
    for scene in range(40):
        points = places(solids, scene, 2)
        piece = inside(solids, scene, 2, points)
        assert (inside(solids, scene, 0, points) & piece).any()
    outside = [
        (inside(solids, s, 2, p) & ~inside(solids, s, 0, p)).any()
        for s in range(40)
        for p in [places(solids, s, 2)]
    ]
    assert np.mean(outside) > 0.7


def test_shares_and_scenes_that_stay():
    changed = np.arange(40) < 30
    solids, holes = made(hollow=0.4, pieces=0.2, changed=changed)
    assert not holes.present[30:].any()
    assert not solids.present[30:, 2:].any()
    assert solids.present[:, :2].all()
    assert 0.2 < holes.present[:30, :2].float().mean() < 0.6
    assert 0.05 < solids.present[:30, 2:].float().mean() < 0.4
    given = scenes()
    given.present[:, 1] = False
    solids, holes = made(given=given)
    assert not solids.present[:, [1, 3]].any()
    assert not holes.present[:, 1].any()
