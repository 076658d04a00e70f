"""A training of a linear network; run as a script, on one process or on several."""

import multiprocessing
import sys
from dataclasses import dataclass
from pathlib import Path

import lightning
import torch
from torch import nn

from scenefw.data.epochs import EpochBatches
from scenefw.learning.module import TrainingModule
from scenefw.learning.runtime.trainer import TrainerSettings
from scenefw.learning.schedules import CosineDecay
from scenefw.tasks.train import Train

INPUTS = torch.randn(24, 3, generator=torch.Generator().manual_seed(1))
TARGETS = INPUTS.sum(dim=1, keepdim=True).tanh()


class SquaredError:
    weight = 1.0
    needs_draws = False

    def check(self, setup):
        pass

    def __call__(self, prediction, batch):
        return (prediction - batch.targets).square().mean()


@dataclass(frozen=True)
class Batch:
    inputs: torch.Tensor
    targets: torch.Tensor


class Network(nn.Module):
    """Two layers, and statistics of batches only if asked for."""

    training_only = ()

    def __init__(self, normalised=False):
        super().__init__()
        torch.manual_seed(0)
        self.recipe = {"_target_": "scenefw.none", "normalised": normalised}
        self.first = nn.Linear(3, 8)
        self.between = nn.BatchNorm1d(8) if normalised else nn.Tanh()
        self.last = nn.Linear(8, 1)

    def forward(self, inputs):
        return self.last(self.between(self.first(inputs)))


class Learning(TrainingModule):
    """Squared errors; `failing` is the process that breaks down at the third step."""

    task = "plain"

    def __init__(self, folder, failing=None, **options):
        settings = {"average": 0.9, "seed": 0, "compile": False, **options}
        schedule = CosineDecay(steps=30, warmup=2)
        losses = {"error": SquaredError()}
        super().__init__(Network(), losses, 1e-2, 0.0, schedule, **settings)
        self.folder, self.failing = Path(folder), failing
        self.gradients = []

    def facts(self):
        return {}

    def setup_with(self, data):
        return None

    def predict_batch(self, batch):
        if self.failing == self.global_rank and self.batches_seen == 2:
            raise ValueError("no more\nnumbers")
        return self.model(batch.inputs)

    def validation_step(self, batch, batch_idx):
        error = (self.model(INPUTS[batch.indices]) - TARGETS[batch.indices]).square().mean()
        self.log_dict({"val/error": error}, batch_size=len(batch.indices), sync_dist=True)

    def on_before_optimizer_step(self, optimizer):
        self.gradients.append([p.grad.clone() for p in self.model.parameters()])

    def on_train_end(self):
        kept = {"gradients": self.gradients, "weights": self.model.state_dict()}
        torch.save(kept, self.folder / f"process_{self.global_rank}.pt")


class Data(lightning.LightningDataModule):
    """Twenty-four samples."""

    grid = None

    def __init__(self, batch_size):
        super().__init__()
        self.batch_size = batch_size

    def facts(self):
        return {}

    def training_batch(self, batch, device):
        return Batch(INPUTS[batch.indices], TARGETS[batch.indices])

    def train_dataloader(self):
        return EpochBatches(24, self.batch_size, 0, *self._processes())

    def val_dataloader(self):
        return EpochBatches(4, 2, None, *self._processes())

    def _processes(self):
        return self.trainer.global_rank, self.trainer.world_size


def task(folder, steps, processes=1, batch_size=4, learning=None, **limits):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    settings = {"max_epochs": -1, "gradient_clip": None, **limits}
    trainer = TrainerSettings("cpu", processes, max_steps=steps, **settings)
    return Train(
        Learning(folder, **(learning or {})),
        Data(batch_size),
        trainer,
        folder / "out",
        folder / "state",
        snapshot_steps=1000,
        log_every=1,
        name="plain",
    )


def state(folder):
    return torch.load(Path(folder) / "state" / "last.ckpt", weights_only=True)


if __name__ == "__main__":
    # HOW FOLDER STEPS: a training of two processes; the second one starts as HOW says
    how, where, steps = sys.argv[1:]
    started = multiprocessing.get_context(how)
    multiprocessing.get_context = lambda *_: started
    failing = {"failing": 1} if Path(where).name == "failing" else {}
    task(where, int(steps), processes=2, batch_size=2, learning=failing).run()
