"""A training of milliseconds per step; run as a script, it may kill itself on the way."""

import os
import signal
import sys
from pathlib import Path

import lightning
import numpy as np
import torch

from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, GridSpec
from scenefw.data.batches.augmentation import RigidAugmentation
from scenefw.data.batches.stack_volumes import StackData
from scenefw.data.batches.views import ViewMaker
from scenefw.learning.runtime.trainer import TrainerSettings
from scenefw.learning.schedules import CosineDecay
from scenefw.learning.shape_instance import ShapeInstanceLearning
from scenefw.losses.mmd import MaximumMeanDiscrepancy
from scenefw.losses.partial_tsdf import PartialTsdfLoss
from scenefw.losses.tsdf import TsdfLoss
from scenefw.losses.votes import VoteLoss
from scenefw.mapping.projective import Projective
from scenefw.metrics.absolute_error import AbsoluteError
from scenefw.metrics.expected_occupancy import ExpectedOccupancy
from scenefw.metrics.occupancy_overlap import OccupancyOverlap
from scenefw.models.shape_instance_vae import ShapeInstanceVAE
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw.tasks.train import Train


class Circle:
    camera = Camera(40, 30, 35.0, 35.0, 19.5, 14.5)

    def sample(self, rng):
        return self.camera.moved(self._pose(rng.uniform(-np.pi, np.pi)))

    def poses(self, streams):
        return self._pose(np.pi * (2 * streams.uniform(1)[:, 0] - 1))

    def _pose(self, angle):
        eye = (0.9 * np.cos(angle), 0.9 * np.sin(angle), np.full_like(angle, 0.7))
        return look_at(np.stack(eye, axis=-1), (0, 0, 0.1))


def network(resolution=8):
    torch.manual_seed(0)
    return ShapeInstanceVAE(
        resolution,
        latent_size=4,
        bottleneck=4,
        condition_widths=(4, 4, 4, 4, 4),
        encoder_widths=(4, 4, 4, 4, 4),
        decoder_widths=(4, 4, 4, 4, 4),
        stem_width=4,
        branch_width=4,
        code_width=0,
        prior_share=0.4,
    )


def views(resolution=8):
    return ViewMaker(
        GridSpec(resolution), Circle(), SphereTracer(), Projective(), {}, RigidAugmentation()
    )


def data(stacks, resolution=8, **options):
    sizes = {"limit": 8, "validation_limit": 2, "batch_size": 2}
    return StackData(views(resolution), path=str(stacks), **{**sizes, **options})


METRICS = {
    "iou": OccupancyOverlap(),
    "tsdf": AbsoluteError(in_truncations=True),
    "sample_iou": OccupancyOverlap(of_samples=True),
    "sample_bce": ExpectedOccupancy(),
}


def learning(resolution=8, **options):
    losses = {
        "tsdf": TsdfLoss(),
        "votes": VoteLoss(1.0),
        "partial_tsdf": PartialTsdfLoss(1.0),
        "mmd": MaximumMeanDiscrepancy(),
    }
    return ShapeInstanceLearning(
        network(resolution),
        losses,
        METRICS,
        **{"learning_rate": 1e-2, "schedule": CosineDecay(steps=20, warmup=3), **options},
    )


def task(stacks, folder, steps, resolution=8, **options):
    """Four batches of two scenes per epoch."""
    trainer = TrainerSettings("cpu", max_steps=steps, max_epochs=-1, validate_every=3)
    folder = Path(folder)
    return Train(
        learning(resolution),
        data(stacks, resolution),
        trainer,
        folder / "out",
        folder / "state",
        snapshot_steps=2,
        log_every=1,
        **options,
    )


class Killer(lightning.Callback):
    """Kills the process, as `kill -9` does, once so many batches are done."""

    def __init__(self, after):
        self.after = after

    def on_train_batch_start(self, trainer, module, *_):
        if module.batches_seen == self.after:
            os.kill(os.getpid(), signal.SIGKILL)


class Signals(lightning.Callback):
    """Sends itself signals in the step after so many batches."""

    def __init__(self, after, *signals):
        self.after, self.signals = after, signals

    def on_train_batch_start(self, trainer, module, *_):
        if module.batches_seen == self.after:
            for number in self.signals:
                os.kill(os.getpid(), number)


if __name__ == "__main__":
    doomed = {"callbacks": {"killer": Killer(5)}} if "kill" in sys.argv[3:] else {}
    task(*sys.argv[1:3], steps=9, **doomed).run()
