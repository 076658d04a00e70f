"""Training steps beside another program that keeps a core busy, and what that care costs alone.

As `scale=laptop`: 8 scenes of 32^3 voxels, data, forward, backward, optimiser; many steps a time.
Ours wait as a run does (`yielding=true`); the time until the other program is noticed counts. The
peer of the first job waits busily always (`yielding=false`): nothing is lost alone if the ratio is
0.97 or more. That of the second is ours without another program: the ratio is the share of the
quiet rate that is left, and should be 0.5 or more on two cores. Where variables of OpenMP choose
how threads wait there is nothing to compare, and no job.
"""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import torch

from benchmarks.harness import Job, Timed
from benchmarks.training_data import data_side
from scenefw.core.cores import supplies
from scenefw.core.types import GridSpec
from scenefw.core.waiting import environment_decides, yielding
from scenefw.losses.partial_tsdf import PartialTsdfLoss
from scenefw.losses.sample_spread import SampleSpread
from scenefw.losses.tsdf import TsdfLoss
from scenefw.losses.votes import VoteLoss
from scenefw.models.shape_instance_vae import ShapeInstanceVAE

GRID = GridSpec(resolution=32)
STEPS = 12


def training() -> Callable[[], None]:
    """One step."""
    data = data_side(noise=False, grid=GRID, device="cpu", scenes=8)
    model = ShapeInstanceVAE(GRID.resolution, code_width=8, zero_share=0.1, prior_share=0.9)
    losses = (TsdfLoss(), VoteLoss(), PartialTsdfLoss(), SampleSpread())
    optimizer = torch.optim.AdamW(model.parameters())

    def step() -> None:
        batch = data()
        prediction = model(batch, torch.Generator())
        total = sum(loss.weight * loss(prediction, batch) for loss in losses)
        optimizer.zero_grad()
        total.backward()
        optimizer.step()

    return step


def steps(*, waits: bool, busy: bool) -> Timed:
    """Many steps, with threads that wait as in a run or busily, beside a busy program or alone."""
    step = training()

    def run() -> None:
        with beside(1 if busy else 0), yielding(torch.get_num_threads, enabled=waits):
            for _ in range(STEPS):
                step()

    return run


@contextmanager
def beside(count: int) -> Iterator[None]:
    """Inside, so many other programs keep a core busy each."""
    work = [sys.executable, "-c", "while True: pass"]
    others = [subprocess.Popen(work) for _ in range(count)]
    try:
        yield
    finally:
        for other in others:
            os.kill(other.pid, signal.SIGKILL)
            other.wait()


_WHAT = f"{STEPS} training steps, 8 scenes, 32^3, cpu"
_TO_COMPARE = bool(supplies()) and not environment_decides()
JOBS = (
    [
        Job(
            f"{_WHAT}, alone",
            lambda: steps(waits=True, busy=False),
            {"waiting busily": lambda: steps(waits=False, busy=False)},
            repeats=3,
            seconds=30,
        ),
        Job(
            f"{_WHAT}, beside a busy program",
            lambda: steps(waits=True, busy=True),
            {"the same alone": lambda: steps(waits=True, busy=False)},
            repeats=3,
            seconds=30,
        ),
    ]
    if _TO_COMPARE
    else []
)
