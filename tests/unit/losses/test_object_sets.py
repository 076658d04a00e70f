import dataclasses
import itertools

import numpy as np
import pytest
import torch
from scipy import ndimage
from tests.unit.models.sets import boxes
from torch.nn.functional import binary_cross_entropy, binary_cross_entropy_with_logits

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.object_sets import ObjectSetPrediction, ObjectSetSetup
from scenefw.core.types import GridSpec
from scenefw.losses.set_bce import SetBinaryCrossEntropy
from scenefw.losses.set_boxes import SetBoxes, boxes_of
from scenefw.losses.set_cells import SetCells, cells_of_objects
from scenefw.losses.set_centres import SetCentres
from scenefw.losses.set_divergence import SetDivergence
from scenefw.losses.set_existence import SetExistence
from scenefw.losses.set_mmd import SetDiscrepancy
from scenefw.losses.set_overlap import SetOverlap
from scenefw.losses.set_partial import SetPartial
from scenefw.matching.object_sets import matched_objects


def prediction(batch, slots=4):
    generator = torch.Generator().manual_seed(0)

    def draw(*shape):
        return torch.randn(shape, generator=generator).requires_grad_()

    found = ObjectSetPrediction(
        draw(2, slots, 16, 16, 16),
        draw(2, slots, 5),
        torch.zeros(2, slots, dtype=torch.int64),
        draw(2, 5, 4, 4, 4),
        existence=draw(2, slots),
        centres=draw(2, slots, 3),
        boxes=draw(2, slots, 2, 3),
        partial=draw(2, 1, 16, 16, 16),
        latent=draw(2, 5, 4, 4, 4),
    )
    matched = matched_objects(found.logits, batch.instances, batch.present)
    return dataclasses.replace(found, matched=matched)


@pytest.fixture
def batch():
    return boxes()


def test_cross_entropy_is_against_the_matched_object_or_nothing(batch):
    found = prediction(batch)
    truth = torch.zeros_like(found.logits)
    for scene, slot in itertools.product(range(2), range(4)):
        i = int(found.matched[scene, slot])
        truth[scene, slot] = (batch.instances[scene] == i + 1) if i >= 0 else 0
    loss = SetBinaryCrossEntropy()(found, batch)
    expected = binary_cross_entropy_with_logits(found.logits, truth)
    torch.testing.assert_close(loss, expected)
    loss.backward()
    step = (found.logits.detach().sigmoid() - truth) / truth.numel()
    torch.testing.assert_close(found.logits.grad, step)


def test_overlap_is_one_minus_dice_of_matched_predictions(batch):
    found = prediction(batch)
    terms = []
    for scene, slot in itertools.product(range(2), range(4)):
        i = int(found.matched[scene, slot])
        if i < 0:
            continue
        truth = (batch.instances[scene] == i + 1).double()
        shares = found.logits[scene, slot].detach().double().sigmoid()
        terms.append(1 - (2 * (shares * truth).sum() + 1) / (shares.sum() + truth.sum() + 1))
    loss = SetOverlap()(found, batch)
    assert float(loss.detach()) == pytest.approx(float(np.mean(terms)), rel=1e-5)
    loss.backward()
    unmatched = found.logits.grad[found.matched < 0]
    assert len(unmatched)
    assert not unmatched.any()
    sure = dataclasses.replace(found, logits=found.logits.detach().clone())
    for scene, slot in itertools.product(range(2), range(4)):
        inside = batch.instances[scene] == int(sure.matched[scene, slot]) + 1
        sure.logits[scene, slot] = torch.where(inside, 50.0, -50.0)
    assert float(SetOverlap()(sure, batch)) == pytest.approx(0.0, abs=1e-6)


def test_existence_is_of_matched_predictions(batch):
    found = prediction(batch)
    expected = binary_cross_entropy(found.existence.sigmoid(), (found.matched >= 0).float())
    torch.testing.assert_close(SetExistence()(found, batch), expected)


def test_centres_are_those_of_matched_objects(batch):
    found = prediction(batch)
    errors = [
        np.linalg.norm(found.centres[b, n].detach() - batch.centres[b, int(found.matched[b, n])])
        for b, n in itertools.product(range(2), range(4))
        if found.matched[b, n] >= 0
    ]
    assert float(SetCentres()(found, batch).detach()) == pytest.approx(np.mean(errors))
    assert len(errors) == 3


def test_boxes_are_those_of_matched_objects(batch):
    found = prediction(batch)
    errors = []
    for scene, slot in itertools.product(range(2), range(4)):
        i = int(found.matched[scene, slot])
        if i < 0:
            continue
        sides = ndimage.find_objects(batch.instances[scene].numpy())[i]
        true = np.array([[side.start, side.stop] for side in sides]).T / 8 - 1
        centre, half = found.boxes[scene, slot].detach().numpy()
        errors.append(np.abs(np.stack([centre - half, centre + half]) - true).mean())
        assert boxes_of(batch.instances, 3)[scene, i].numpy() == pytest.approx(true)
    assert len(errors) == 3
    assert float(SetBoxes()(found, batch).detach()) == pytest.approx(np.mean(errors), rel=1e-5)


def test_every_object_gets_the_nearest_cell_that_is_left():
    corner = torch.tensor([[-0.75, -0.75, -0.75], [-0.7, -0.75, -0.75], [0.75, 0.75, 0.75]])
    present = torch.tensor([[True, True, False], [True, False, True]])
    cells = cells_of_objects(corner.expand(2, 3, 3), present, 4)
    assert cells.sum(dim=1).tolist() == [2, 2]
    first = [torch.unravel_index(i, (4, 4, 4)) for i in cells[0].nonzero()[:, 0]]
    assert [[int(x) for x in at] for at in first] == [[0, 0, 0], [1, 0, 0]]
    assert cells[1].nonzero()[:, 0].tolist() == [0, 63]


def test_cells_push_means_up_where_objects_are_and_down_elsewhere(batch):
    found = prediction(batch)
    SetCells()(found, batch).backward()
    wanted = cells_of_objects(batch.centres, batch.present, 4)
    gradient = found.features.grad.mean(dim=1).flatten(1)
    assert (gradient[wanted] < 0).all()
    assert (gradient[~wanted] > 0).all()
    sums = [float(gradient[mask].abs().sum()) for mask in (wanted, ~wanted)]
    assert 0.2 < sums[0] / sums[1] < 5  # 3 cells weigh as much as 125


def test_volumes_like_the_prior_discrepate_less(batch):
    found = prediction(batch)
    for per_cell in (False, True):
        loss = SetDiscrepancy(per_cell=per_cell)
        far = dataclasses.replace(found, latent=found.latent + 3)
        assert float(loss(found, batch).detach()) < float(loss(far, batch).detach()) - 0.1
    with pytest.raises(ConfigError, match="bandwidth = 0"):
        SetDiscrepancy(bandwidth=0)


def test_divergence_is_a_mean_over_scenes(batch):
    found = dataclasses.replace(prediction(batch), divergence=torch.tensor([1.0, 4.0]))
    assert float(SetDivergence()(found, batch)) == 2.5
    with pytest.raises(InputError, match="set_placed_vae"):
        SetDivergence()(prediction(batch), batch)


def test_the_rebuilt_view_is_compared_with_its_distances(batch):
    found = prediction(batch)
    expected = np.abs(found.partial.detach().numpy() - batch.condition[:, :1].numpy()).mean()
    assert float(SetPartial()(found, batch).detach()) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize(
    "loss", [SetExistence, SetCentres, SetBoxes, SetDivergence, SetDiscrepancy, SetPartial]
)
def test_a_network_without_what_is_compared_is_refused_before_the_work(loss):
    setup = ObjectSetSetup(GridSpec(16), 4, frozenset())
    with pytest.raises(ConfigError, match=r"the loss set_\w+ needs .* choose model"):
        loss().check(setup)
    names = {"existence", "centres", "boxes", "partial", "latent", "divergence"}
    loss().check(ObjectSetSetup(setup.grid, 4, frozenset(names)))


def test_unmatched_predictions_are_no_loss(batch):
    unmatched = dataclasses.replace(prediction(batch), matched=None)
    with pytest.raises(InputError, match="match predictions"):
        SetBinaryCrossEntropy()(unmatched, batch)


@pytest.mark.parametrize("per_cell", [False, True])
def test_discrepancy_is_of_whole_volumes_or_of_their_cells(per_cell):
    """By hand: expectations over N(0, I) from many draws of it."""
    latent = torch.randn(3, 2, 2, 2, 2, generator=torch.Generator().manual_seed(1)).double() + 0.5
    if per_cell:
        samples = [one[:, i, j, k] for one in latent for i, j, k in np.ndindex(2, 2, 2)]
    else:
        samples = [one.flatten() for one in latent]
    codes = torch.stack(samples)
    variance = 0.7 * codes.shape[1]
    drawn = torch.randn(
        2, 3000, codes.shape[1], generator=torch.Generator().manual_seed(2)
    ).double()

    def alike(first, second):
        return (-(torch.cdist(first, second) ** 2) / (2 * variance)).exp()

    own = alike(codes, codes)
    within = (own.sum() - own.trace()) / (len(codes) * (len(codes) - 1))
    expected = within - 2 * alike(codes, drawn[0]).mean() + alike(*drawn).mean()
    batch = boxes()
    found = SetDiscrepancy(bandwidth=0.7, per_cell=per_cell)(
        dataclasses.replace(prediction(batch), latent=latent), batch
    )
    assert float(found) == pytest.approx(float(expected), abs=0.01)
