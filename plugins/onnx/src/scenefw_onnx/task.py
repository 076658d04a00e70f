"""Writes the network of a file of weights as ONNX."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from scenefw.core.errors import ConfigError
from scenefw.core.files import require_writable
from scenefw.core.versions import versions
from scenefw.learning.checkpoint import load_checkpoint, weights_file
from scenefw.learning.provenance import Provenance, read_provenance
from scenefw_onnx.files import require_onnx, write_onnx
from scenefw_onnx.networks import named_network


class ExportONNX:
    """Exports the test pass of a network and compares it with torch (`run=export_onnx`).

    Writes `NAME.onnx`. Names and sizes of its inputs and outputs are printed, and the largest
    difference between onnxruntime and torch.

    Args:
        checkpoint: file of weights, or the name of weights that come with scenefw or a plugin; None
            means those named `shipped`.
        output: the run's folder.
        shipped: name of the weights that are meant if none are given.
        tolerance: largest difference, see `export.onnx_files.write_onnx`.
        seed: of the inputs that both are compared on.

    Raises:
        ConfigError: the tolerance is not positive.
    """

    def __init__(
        self,
        checkpoint: str | Path | None,
        output: str | Path,
        shipped: str = "simstack",
        tolerance: float = 1e-4,
        seed: int = 0,
    ) -> None:
        if not tolerance > 0:
            raise ConfigError(f"run.tolerance = {tolerance}: expected a number above 0")
        self.checkpoint, self.output, self.shipped = checkpoint, Path(output), shipped
        self.tolerance, self.seed = tolerance, seed

    def run(self) -> dict[str, float]:
        """Exports the network; returns the largest difference and the file's size.

        Raises:
            CheckpointError: weights are missing, damaged, or of a network that isn't exported.
            InputError: the network can't be exported, or onnxruntime's results differ.
            MissingDependencyError: onnx, onnxruntime or onnxscript is not installed.
            StorageError: the folder can't be written.
        """
        require_onnx()
        require_writable(self.output)
        file = weights_file(self.checkpoint, self.shipped)
        provenance = read_provenance(file)
        network = named_network(load_checkpoint(file, task=provenance.task), provenance.task)
        target = self.output / f"{file.stem}.onnx"
        difference = write_onnx(target, network, _facts(provenance), self.tolerance, self.seed)
        for kind, tensors in (("input", network.inputs), ("output", network.outputs)):
            for name, shape in tensors.items():
                print(f"{kind:<6} {name}: {' x '.join(map(str, shape))}")
        print(f"largest difference between onnxruntime and torch: {difference:.1e}")
        print(target)
        return {"difference": difference, "megabytes": target.stat().st_size / 1e6}


def _facts(provenance: Provenance) -> dict[str, Any]:
    """Where the weights come from, and the grid that they are for."""
    facts: dict[str, Any] = {
        "checkpoint": provenance.path.name,
        "sha256": provenance.digest,
        "task": provenance.task,
        "network": provenance.recipe["_target_"],
        "versions": versions(),
        "training_commit": provenance.metadata.get("commit"),
    }
    return facts | (
        {} if provenance.grid is None else {"grid": dataclasses.asdict(provenance.grid)}
    )
