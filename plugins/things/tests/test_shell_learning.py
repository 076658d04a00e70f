"""Training of object shells: it learns, and its scores are those of solids."""

from functools import partial

import numpy as np
import torch
from plugins.things.tests.things_folder import write_things

from scenefw.core.batches import IndexBatch
from scenefw_things.shapes.part_unions import inside
from scenefw_things.shells.batches import ShellPrediction
from scenefw_things.shells.data import ObjectShells as Data
from scenefw_things.shells.depth_loss import ShellDepth
from scenefw_things.shells.learning import ObjectShellLearning, object_shell, scores, visible_points
from scenefw_things.shells.mask_loss import ShellMask
from scenefw_things.shells.network import ObjectShells
from scenefw_things.shells.solid_measures import Solid

CPU = torch.device("cpu")
BATCH = IndexBatch(0, torch.tensor([0, 1]))


def data(folder):
    return Data(write_things(folder), batch_size=2, objects=2, resolution=32, min_pixels=20)


def test_it_learns_one_batch_by_heart(tmp_path):
    batch, losses = data(tmp_path).training_batch(BATCH, CPU), (ShellMask(), ShellDepth(4.0))
    torch.manual_seed(0)
    network = ObjectShells((12, 16, 24), latent_size=4)
    optimiser = torch.optim.AdamW(network.parameters(), 1e-2)
    costs = []
    for _ in range(60):
        prediction = network(batch.crops)
        costs.append(sum(loss.weight * loss(prediction, batch) for loss in losses))
        optimiser.zero_grad()
        costs[-1].backward()
        optimiser.step()
    assert float(costs[-1].detach()) < 0.25 * float(costs[0].detach())


def test_the_true_shells_score_best(tmp_path):
    made = data(tmp_path)
    batch, solids = made.validation_batch(BATCH, CPU), made.validation_solids(BATCH)
    true = batch.shells
    prediction = ShellPrediction(true.amodal.float() - 0.5, true.hollow.float() - 0.5, true.depths)
    rows = []
    for number, (parts, surface) in enumerate(solids):
        truth = Solid(partial(inside, parts=parts), surface)
        points = visible_points(batch.crops)[number]
        shell = object_shell(number, batch.crops, prediction)
        rows.append(scores(shell, points, truth, np.random.default_rng(0)))
    shell, standing, visible = np.mean(rows, axis=0)
    assert shell[1] > max(standing[1], visible[1]) + 0.1
    assert shell[0] < min(standing[0], visible[0])


def test_codes_are_drawn_for_a_part_of_the_crops(tmp_path):
    learning = ObjectShellLearning(ObjectShells((8, 12), drawn=0.5), {"mask": ShellMask()}, 1e-3)
    made = data(tmp_path)
    assert learning.setup_with(made).drawn == 2
