"""A training step of the thesis's recipes on one core: as the queue takes it, beside float32.

Data, forward, backward and optimiser, steps of the ledger's batch. The peer computes in float32 and
compiles nothing; that is what the recipes did before there was a queue.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

import numba
import torch

from benchmarks.harness import Job, Timed
from benchmarks.trainings import Ledger
from scenefw import config, plugins
from scenefw.core.batches import IndexBatch

FEW = {
    "thesis_simstack": ["size.validation_scenes=8"],
    "thesis_label_views": ["size.tables=12", "size.validation_tables=2"],
    "thesis_label_maps": ["size.tables=12", "size.validation_tables=2"],
    "thesis_set_autoencoder": ["size.validation_scenes=8", "dataset.path=large_stacks_v2"],
}
"""Little to prepare, by training; a step costs the same."""
_CPU = torch.device("cpu")
_EPOCH = 8  # steps of a batch of 8, of 12 tables seen five times


def step(name: str, *, queued: bool) -> Timed:
    """A step of a training of the ledger."""
    from hydra.utils import instantiate

    plugins.activate()
    training = Ledger().trainings[name]
    words = [*training.command, *training.core.changes, "device=cpu"]
    whole = config.compose([*words, *FEW[name]])
    learning = instantiate(whole.learning, _convert_="all")
    data = instantiate(whole.dataset, _convert_="all")
    data.setup("fit")
    batches = _batches(data.train_dataloader().batch)
    optimizer = learning.optimizer.make(
        learning.model, learning.learning_rate, learning.weight_decay, fused=True
    )
    calls = dict(learning.losses)
    if queued and learning.compiled:
        learning.model.compile()
        calls = {name: torch.compile(loss.__call__) for name, loss in calls.items()}

    def run() -> None:
        with on_one_core():
            batch = data.training_batch(next(batches), _CPU)
            with torch.autocast("cpu", torch.bfloat16, enabled=queued):
                prediction = learning.predict_batch(batch)
                losses = learning.losses_now()
                total = sum(v.weight * calls[n](prediction, batch) for n, v in losses.items())
            optimizer.zero_grad()
            total.backward()
            optimizer.step()
            learning.batches_seen += 1

    for _ in range(_EPOCH):  # in which all views are rendered that are kept
        run()
    return run


def _batches(batch: Callable[[int], IndexBatch]) -> Iterator[IndexBatch]:
    number = 0
    while True:
        yield batch(number)
        number += 1


@contextmanager
def on_one_core() -> Iterator[None]:
    """One thread of torch and of numba."""
    before = torch.get_num_threads(), numba.get_num_threads()
    torch.set_num_threads(1)
    numba.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before[0])
        numba.set_num_threads(before[1])


JOBS = [
    Job(
        f"training step of {name} on one core",
        partial(step, name, queued=True),
        {"float32, not compiled": partial(step, name, queued=False)},
        repeats=8,
        seconds=20.0,
    )
    for name in FEW
]
