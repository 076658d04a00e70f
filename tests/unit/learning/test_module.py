"""What all trainings share: where batches are made, in which precision."""

import torch
from tests.unit.learning.plain import Data, Learning
from torch import nn

from scenefw.core.batches import IndexBatch
from scenefw.learning.runtime.trainer import TrainerSettings


class Watched(Data):
    """Keeps in which precision its batches are made."""

    def __init__(self):
        super().__init__(4)
        self.seen = []

    def training_batch(self, batch, device):
        self.seen.append(("training", torch.is_autocast_enabled("cpu")))
        return super().training_batch(batch, device)

    def validation_batch(self, batch, device):
        self.seen.append(("validation", torch.is_autocast_enabled("cpu")))
        return super().training_batch(batch, device)


class Validating(Learning):
    """Also validates on batches of the data module."""

    mixed = False

    def predict_batch(self, batch):
        self.mixed = torch.is_autocast_enabled("cpu")
        return super().predict_batch(batch)

    def validation_step(self, batch: IndexBatch, batch_idx):
        made = self.validation_batch(batch)
        self.log("val/error", nn.functional.mse_loss(self.model(made.inputs), made.targets))


def test_batches_keep_float32_in_a_training_of_mixed_precision(tmp_path):
    data, learning = Watched(), Validating(tmp_path)
    settings = TrainerSettings(
        "cpu", precision="bf16-mixed", max_epochs=-1, max_steps=2, validate_every=1
    )
    limits = settings.limits(lambda: 0.0, 0.0)
    settings.build(tmp_path, [limits]).fit(learning, data)
    assert learning.mixed
    assert {kind for kind, _ in data.seen} == {"training", "validation"}
    assert not any(mixed for _, mixed in data.seen)
