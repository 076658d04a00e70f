"""ONNX: a network in one file for any runtime, compared with torch before it is kept."""

from __future__ import annotations

import json
import logging
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import torch

from scenefw.core.errors import InputError, MissingDependencyError
from scenefw.core.files import replacing
from scenefw_onnx.networks import NamedNetwork

_PREFIX = "scenefw."


def require_onnx() -> tuple[ModuleType, ModuleType]:
    """The libraries onnx and onnxruntime.

    Raises:
        MissingDependencyError: one that is needed is not installed.
    """
    try:
        import onnx
        import onnxruntime
        import onnxscript  # noqa: F401 - torch's exporter needs it
    except ImportError as error:
        raise MissingDependencyError(
            f"ONNX files need {error.name}: pip install 'scenefw[onnx]'"
        ) from error
    return onnx, onnxruntime


def write_onnx(
    path: Path, network: NamedNetwork, facts: Mapping[str, Any], tolerance: float, seed: int = 0
) -> float:
    """Writes a network, if onnxruntime gives what torch gives; returns the largest difference.

    Both run on the CPU in float32, on random inputs of all of the network's example sizes. Facts
    become metadata of the file, as `scenefw.NAME` in JSON.

    Args:
        path: the file, replaced as a whole.
        network: in eval mode, on the CPU.
        facts: plain data by name.
        tolerance: of differences, as a share of the largest value of an output where that is above
            one.
        seed: of the inputs.

    Raises:
        InputError: the network can't be exported, or the results differ.
        MissingDependencyError: onnx, onnxruntime or onnxscript is not installed.
        StorageError: the file can't be written.
    """
    onnx, _ = require_onnx()
    model = _exported(network, torch.Generator().manual_seed(seed))
    for name, fact in {**facts, **network.facts}.items():
        model.metadata_props.add(key=_PREFIX + name, value=json.dumps(fact))
    onnx.checker.check_model(model)
    content = model.SerializeToString()
    largest = compare(content, network, tolerance, seed)
    with replacing(path) as temporary:
        temporary.write_bytes(content)
    return largest


def session(file: Path | bytes, threads: int | None = None) -> Any:
    """The session in which onnxruntime runs a file or its content, on the CPU.

    Args:
        file: as `write_onnx` wrote it.
        threads: of each operation; None = those of torch.
    """
    _, runtime = require_onnx()
    options = runtime.SessionOptions()
    options.intra_op_num_threads = threads or torch.get_num_threads()
    options.inter_op_num_threads = 1
    model = file if isinstance(file, bytes) else str(file)
    return runtime.InferenceSession(model, options, providers=["CPUExecutionProvider"])


def compare(content: bytes, network: NamedNetwork, tolerance: float, seed: int = 0) -> float:
    """The largest difference between onnxruntime and torch, of all outputs and example sizes.

    Raises:
        InputError: it is above the tolerance (see `write_onnx`), or no number.
    """
    run = session(content)
    largest = 0.0
    for number, sizes in enumerate(network.sizes):
        inputs = network.example(sizes, torch.Generator().manual_seed(seed + number))
        with torch.no_grad():
            references = network.module(*inputs)
        feeds = {n: x.numpy() for n, x in zip(network.inputs, inputs, strict=True)}
        results = run.run(list(network.outputs), feeds)
        for name, reference, result in zip(network.outputs, references, results, strict=True):
            difference = float(np.abs(reference.numpy() - result).max())
            allowed = tolerance * max(1.0, float(reference.abs().max()))
            if not difference <= allowed:
                raise InputError(
                    f"onnxruntime's {name} differs from torch's by {difference:.2g}, expected at "
                    f"most {allowed:.2g}; nothing was written, run.tolerance=... allows more"
                )
            largest = max(largest, difference)
    return largest


def _exported(network: NamedNetwork, generator: torch.Generator) -> Any:
    """An ONNX model whose tensors and dimensions have the network's names."""
    example = network.example(network.sizes[0], generator)
    free = torch.export.Dim.DYNAMIC
    shapes = tuple(
        {axis: free for axis, size in enumerate(shape) if isinstance(size, str)}
        for shape in network.inputs.values()
    )
    try:
        with _quiet(), torch.no_grad():
            program = torch.onnx.export(
                network.module,
                example,
                input_names=list(network.inputs),
                output_names=list(network.outputs),
                dynamic_shapes=shapes,
                dynamo=True,
                verbose=False,
            )
    except (torch.onnx.errors.OnnxExporterError, RuntimeError) as error:
        reason = " ".join(str(error.__cause__ or error).split())[:300]
        raise InputError(
            f"torch can't export the network: {reason} ...; its test pass must be one that "
            "torch.export can trace, for inputs of any size that isn't fixed"
        ) from error
    model = program.model_proto
    for tensor, shape in zip(
        (*model.graph.input, *model.graph.output),
        (*network.inputs.values(), *network.outputs.values()),
        strict=True,
    ):
        for dimension, size in zip(tensor.type.tensor_type.shape.dim, shape, strict=True):
            if isinstance(size, str):
                if not dimension.dim_param:
                    raise InputError(
                        f"the exported network works for one {size} alone, {dimension.dim_value}; "
                        "in its test pass, let nothing depend on that"
                    )
                dimension.dim_param = size
    del model.graph.value_info[:]  # its dimensions have other names
    for node in model.graph.node:  # traces of where torch was called, with paths of this machine
        del node.metadata_props[:]
    return model


@contextmanager
def _quiet() -> Iterator[None]:
    """Without the exporter's remarks on libraries that aren't needed, and on its own parts."""
    log = logging.getLogger("torch.onnx")
    before = log.level
    log.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        log.setLevel(before)
