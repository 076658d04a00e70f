"""The shipped networks in torch and in onnxruntime, as `run=export_onnx` writes them."""

import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

import torch

from benchmarks.harness import Job, Timed
from scenefw.learning.checkpoint import load_checkpoint
from scenefw_onnx.files import session, write_onnx
from scenefw_onnx.networks import NamedNetwork, named_network

THREADS = torch.get_num_threads()
TASKS = {"simstack": "shape_instance", "label_views": "segmentation"}


@cache
def network(name: str) -> NamedNetwork:
    """One of those that ship."""
    task = TASKS[name]
    return named_network(load_checkpoint(None, task=task, shipped=name), task)


def inputs(name: str, **sizes: int) -> tuple[torch.Tensor, ...]:
    """Of nothing in particular: values don't change the time."""
    return network(name).example(sizes, torch.Generator().manual_seed(0))


def in_torch(name: str, **sizes: int) -> Timed:
    """As scenefw predicts."""
    module, given = network(name).module, inputs(name, **sizes)

    def run() -> object:
        with torch.no_grad():
            return module(*given)

    return run


def in_onnxruntime(name: str, **sizes: int) -> Timed:
    """The exported file."""
    with tempfile.TemporaryDirectory() as folder:
        write_onnx(Path(folder) / "a.onnx", network(name), {}, 1e-4)
        runtime = session(Path(folder) / "a.onnx", THREADS)
    given = zip(network(name).inputs, inputs(name, **sizes), strict=True)
    feeds = {key: value.numpy() for key, value in given}
    return lambda: runtime.run(None, feeds)


def codes_in_torch() -> Timed:
    """Three codes of one view, which is encoded once."""
    module, (condition, latent) = network("simstack").module, inputs("simstack", batch=3)

    def run() -> object:
        with torch.no_grad():
            return module(condition[:1], latent)

    return run


def job(what: str, name: str, ours: Callable[[], Timed] | None = None, **sizes: int) -> Job:
    """Both, turn by turn."""
    return Job(
        f"{what}, {name}, {THREADS} threads",
        ours or (lambda: in_torch(name, **sizes)),
        {"onnxruntime": lambda: in_onnxruntime(name, **sizes)},
        seconds=15,
    )


JOBS = [
    job("network of one view, 64^3", "simstack", batch=1),
    job("network of three codes of a view, 64^3", "simstack", codes_in_torch, batch=3),
    job("network of one view, 320 x 240", "label_views", batch=1, height=240, width=320),
]
