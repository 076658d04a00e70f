import lightning
import pytest
import torch
from tests.unit.data.stacks_file import write_stacks
from tests.unit.learning.tiny import views

from scenefw.core.errors import ConfigError
from scenefw.data.batches.object_sets import ObjectSetViews
from scenefw.learning.checkpoint import load_checkpoint
from scenefw.learning.object_sets import ObjectSetLearning, _scores, matched
from scenefw.learning.runtime.trainer import TrainerSettings
from scenefw.learning.schedules import CosineDecay
from scenefw.losses.set_bce import SetBinaryCrossEntropy
from scenefw.losses.set_boxes import SetBoxes
from scenefw.losses.set_cells import SetCells
from scenefw.losses.set_centres import SetCentres
from scenefw.losses.set_existence import SetExistence
from scenefw.losses.set_mmd import SetDiscrepancy
from scenefw.losses.set_overlap import SetOverlap
from scenefw.losses.set_partial import SetPartial
from scenefw.losses.tsdf import TsdfLoss
from scenefw.models.set_autoencoder import SetAutoencoder
from scenefw.models.set_placed import PlacedSetAutoencoder
from scenefw.models.set_vae import SetVAE
from scenefw.tasks.train import Train

STEPS = 90
ONE_BATCH = {"limit": 2, "batch_size": 2, "distinct_batches": 1}
SMALL = {"encoder_widths": (16, 8), "decoder_widths": (16, 16), "code_size": 16}
HEADS = {"existence": True, "centres": True, "attention": True}


@pytest.fixture
def stacks(tmp_path):
    write_stacks(tmp_path / "stacks.npz")
    return str(tmp_path / "stacks.npz")


def data(stacks, **options):
    sizes = {"limit": 4, "validation_limit": 2, "batch_size": 4}
    return ObjectSetViews(views(16), stacks, **{**sizes, **options})


def learn(model, losses, stacks, steps):
    """Scores on the one batch that was trained on, before and after."""
    torch.manual_seed(0)
    made = data(stacks, **ONE_BATCH)
    module = ObjectSetLearning(
        model, losses, learning_rate=1e-2, schedule=CosineDecay(steps=steps, warmup=5), average=0.0
    )
    module.check(made)
    trainer = lightning.Trainer(
        accelerator="cpu",
        max_steps=steps,
        logger=False,
        enable_checkpointing=False,
        enable_progress_bar=False,
        enable_model_summary=False,
        limit_val_batches=0,
    )
    totals = []

    class Totals(lightning.Callback):
        def on_train_batch_end(self, trainer, module, *_):
            totals.append(float(trainer.callback_metrics["train/total"]))

    trainer.callbacks.append(Totals())
    trainer.fit(module, made)
    return module, totals


LOSSES = {
    "set_bce": SetBinaryCrossEntropy(),
    "set_existence": SetExistence(),
    "set_centres": SetCentres(),
    "set_cells": SetCells(),
}
OF_BOXES = {
    "set_bce": SetBinaryCrossEntropy(),
    "set_overlap": SetOverlap(),
    "set_existence": SetExistence(),
    "set_boxes": SetBoxes(),
    "set_cells": SetCells(),
}
OF_VAE = {
    "set_bce": SetBinaryCrossEntropy(200.0),
    "set_mmd": SetDiscrepancy(),
    "set_partial": SetPartial(),
}
NETWORKS = {
    "placed": (lambda: PlacedSetAutoencoder(16, 3, "view", side=4, **SMALL), OF_BOXES),
    "all_heads": (lambda: SetAutoencoder(16, 3, "view", **SMALL, **HEADS), LOSSES),
    "vae": (lambda: SetVAE(16, 3, **SMALL, condition_widths=(8,) * 5, bottleneck=8), OF_VAE),
}


@pytest.mark.parametrize(
    "kind",
    [
        "all_heads",
        *(pytest.param(kind, marks=pytest.mark.exhaustive) for kind in ("placed", "vae")),
    ],
)
def test_it_learns_one_batch_by_heart(stacks, kind):
    """Each network with its losses: objects overlap in the end, which at first don't exist."""
    torch.manual_seed(0)
    make, losses = NETWORKS[kind]
    steps = 3 * STEPS if kind == "placed" else STEPS  # two things to learn: what, and where
    module, totals = learn(make(), losses, stacks, steps=steps)
    assert totals[-1] < (0.5 if "set_overlap" in losses else 0.3) * totals[0]
    made = data(stacks, **ONE_BATCH)
    batch = made.training_batch(made.train_dataloader().batch(0), torch.device("cpu"))
    module.train()
    with torch.no_grad():
        scores = _scores(matched(module.model(batch), batch), batch)
    assert scores["val/object_iou"] > 0.6


def test_a_training_of_the_autoencoder_exports_what_predicts_the_same(stacks, tmp_path):
    torch.manual_seed(0)
    model = SetAutoencoder(16, 3, **SMALL)
    learning = ObjectSetLearning(
        model, {"set_bce": SetBinaryCrossEntropy()}, 2e-3, schedule=CosineDecay(steps=2, warmup=1)
    )
    made = data(stacks)
    settings = TrainerSettings("cpu", max_steps=2, max_epochs=-1, validate_every=1)
    Train(learning, made, settings, tmp_path / "out", tmp_path / "state", name="sets", half=False,
          log_every=1).run()  # fmt: skip
    text = (tmp_path / "out" / "losses.csv").read_text()
    for name in ("train/set_bce", "val/object_iou", "val/missing_or_joined"):
        assert name in text
    stored = load_checkpoint(tmp_path / "out" / "sets.safetensors", task="object_sets")
    assert stored.grid == made.grid
    batch = made.validation_batch(made.val_dataloader().batch(0), torch.device("cpu"))
    with torch.no_grad():
        assert stored.model(batch).logits.shape == (2, 3, 16, 16, 16)


def test_data_that_do_not_fit_the_network_are_refused(stacks):
    losses = {"set_bce": SetBinaryCrossEntropy()}
    with pytest.raises(ConfigError, match=r"model\.slots=3"):
        ObjectSetLearning(SetAutoencoder(16, 2, **SMALL), losses, 2e-3).check(data(stacks))
    with pytest.raises(ConfigError, match="for 8 voxels per side"):
        ObjectSetLearning(SetAutoencoder(8, 3, **SMALL), losses, 2e-3).check(data(stacks))
    others = {**losses, "tsdf": TsdfLoss()}
    with pytest.raises(ConfigError, match=r"the loss tsdf is for .* ObjectSetSetup"):
        ObjectSetLearning(SetAutoencoder(16, 3, **SMALL), others, 2e-3).check(data(stacks))
    with pytest.raises(ConfigError, match=r"model\.existence=true"):
        ObjectSetLearning(
            SetAutoencoder(16, 3, **SMALL), {**losses, "set_existence": SetExistence()}, 2e-3
        ).check(data(stacks))
