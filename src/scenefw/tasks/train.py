"""Trains a network, from the start or from where the last training in a folder stopped."""

import shutil
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import torch

from scenefw.core.errors import CheckpointError
from scenefw.core.files import replacing, require_writable
from scenefw.learning.callbacks import LossTable, ProgressBar, Snapshots
from scenefw.learning.checkpoint import save_checkpoint
from scenefw.learning.divergence import Divergence
from scenefw.learning.module import TrainingModule
from scenefw.learning.trainer import TrainerSettings

_STATE, _TABLE = "last.ckpt", "losses.csv"


class TrainingData(Protocol):
    """A Lightning data module that says what is in it."""

    batch_size: int

    def facts(self) -> Mapping[str, Any]:
        """What the network learns from, as plain data for the checkpoint's metadata."""


class Train:
    """Trains in a stable folder and exports the weights (`run=train`).

    Args:
        learning: what a step does, with its network and losses.
        data: what it learns from, a Lightning data module.
        trainer: how long and on what.
        output: folder of this run, where weights and the table of losses end up.
        folder: keeps the state of the training; one found there is gone on with.
        fresh: start anew even if there is one.
        snapshot_minutes: time between snapshots.
        snapshot_steps: steps between snapshots instead, if given.
        log_every: steps between rows of the table of losses.
        name: file name of the exported weights, without suffix.
        half: export weights as float16.
        lean: leave out of the export what only training needs, such as the scene encoder.
    """

    def __init__(
        self,
        learning: TrainingModule,
        data: TrainingData,
        trainer: TrainerSettings,
        output: Path | str,
        folder: Path | str,
        snapshot_minutes: float = 3.0,
        snapshot_steps: int | None = None,
        log_every: int = 20,
        name: str = "simstack",
        *,
        fresh: bool = False,
        half: bool = True,
        lean: bool = True,
    ) -> None:
        self.learning, self.data, self.trainer = learning, data, trainer
        self.output, self.folder = Path(output), Path(folder)
        self.snapshot_minutes, self.snapshot_steps = snapshot_minutes, snapshot_steps
        self.weights = f"{name}.safetensors"
        self.log_every, self.fresh, self.half, self.lean = log_every, fresh, half, lean

    def run(self) -> Mapping[str, Any]:
        """Trains until a limit of the trainer; returns steps, time and the last scores.

        Raises:
            CheckpointError: the folder holds a training with other settings.
            StorageError: a folder can't be written.
            TrainingError: the training diverged; its last snapshot is kept.
        """
        require_writable(self.output)
        require_writable(self.folder)
        state = self.folder / _STATE
        trainer = self.trainer.build(self.folder, self._callbacks(state))
        resumed = state.exists() and not self.fresh
        if resumed:
            _check(state, self.learning.model.recipe)
        trainer.fit(self.learning, self.data, ckpt_path=str(state) if resumed else None)
        if trainer.interrupted:
            raise KeyboardInterrupt
        self._collect()
        return self._figures(trainer)

    def _callbacks(self, state: Path) -> list[Any]:
        bar = ProgressBar(None if sys.stdout.isatty() else 60.0)
        table = LossTable(self.folder / _TABLE, self.log_every)
        return [
            Divergence(),
            bar,
            table,
            Snapshots(state, self.snapshot_minutes, self.snapshot_steps, self._export),
        ]

    def _export(self) -> None:
        """Writes the averaged weights into the folder of the training."""
        learning, model = self.learning, self.learning.model
        facts = {
            "steps": learning.batches_seen,
            "samples": learning.batches_seen * self.data.batch_size,
            "seconds": round(learning.seconds, 1),
            **self.data.facts(),
            **learning.facts(),
        }
        with learning.averaged():
            save_checkpoint(
                self.folder / self.weights,
                model,
                model.recipe,
                learning.grid,
                facts,
                half=self.half,
                omit=getattr(model, "training_only", ()) if self.lean else (),
                task=learning.task,
            )

    def _collect(self) -> None:
        for name in (self.weights, _TABLE):
            if self.folder.resolve() != self.output.resolve():
                with replacing(self.output / name) as temporary:
                    shutil.copyfile(self.folder / name, temporary)
        print(self.output / self.weights)

    def _figures(self, trainer: Any) -> dict[str, float]:
        figures = {
            "train/steps": float(self.learning.batches_seen),
            "train/seconds": self.learning.seconds,
            "train/parameters": float(sum(p.numel() for p in self.learning.model.parameters())),
        }
        return figures | {n: float(v) for n, v in trainer.callback_metrics.items()}


def _check(state: Path, recipe: Mapping[str, Any]) -> None:
    """Finds out before the work whether a training can be gone on with.

    Raises:
        CheckpointError: it is damaged, or of another network.
    """
    try:
        found = torch.load(state, map_location="cpu", weights_only=False)["scenefw"]["recipe"]
    except Exception as error:  # torch raises many kinds for damaged archives
        raise CheckpointError(
            f"the state {state} is damaged ({type(error).__name__}); start anew with "
            "run.fresh=true, or give another run.folder"
        ) from error
    different = [k for k in recipe if recipe[k] != found.get(k)]
    if different:
        raise CheckpointError(
            f"the training in {state} had another network ({', '.join(different)}); start anew "
            "with run.fresh=true, or give another run.folder"
        )
