"""Trains a network, from the start or from where the last training in a folder stopped."""

import shutil
import time
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import lightning

from scenefw.core.errors import TrainingError
from scenefw.core.files import replacing, require_free, require_name, require_writable
from scenefw.core.settings import COUNT, NOT_NEGATIVE
from scenefw.core.signals import stop_of
from scenefw.core.training_protocols import TrainingData, TrainingLogger
from scenefw.learning.checkpoint import save_checkpoint
from scenefw.learning.module import TrainingModule
from scenefw.learning.runtime.callbacks import ProgressBar, Snapshots
from scenefw.learning.runtime.divergence import Divergence
from scenefw.learning.runtime.interruption import Interruption
from scenefw.learning.runtime.limits import finished
from scenefw.learning.runtime.loggers import LossTable
from scenefw.learning.runtime.processes import processes
from scenefw.learning.runtime.recording import Recording
from scenefw.learning.runtime.state import read_state, state_to_go_on
from scenefw.learning.runtime.trainer import TrainerSettings, device_failed
from scenefw.report.record import command_line, read_record

_STATE, _TABLE = "last.ckpt", "losses.csv"


class Train:
    """Trains in a stable folder and exports the weights (`run=train`).

    Args:
        learning: what a step does, with its network and losses.
        data: what it learns from, a Lightning data module.
        trainer: how long and on what.
        output: folder of this run, where weights and the table of losses end up.
        folder: keeps the state of the training; one found there is resumed.
        fresh: start again even if there is one.
        snapshot_minutes: time between snapshots.
        snapshot_steps: steps between snapshots instead, if given.
        log_every: steps between losses that are logged.
        name: file name of the exported weights, without suffix.
        callbacks: what else happens beside the steps, by name, without those that are None; None:
            `progress` and `divergence`.
        loggers: what keeps losses and scores, by name, likewise; None: `csv`.
        may_change: facts of the training, such as batch_size, in which the state that it resumes
            may differ: its legs may have other batches, on another machine for example.
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
        callbacks: Mapping[str, lightning.Callback | None] | None = None,
        loggers: Mapping[str, TrainingLogger | None] | None = None,
        may_change: Collection[str] = (),
        *,
        fresh: bool = False,
        half: bool = True,
        lean: bool = True,
    ) -> None:
        NOT_NEGATIVE.require(snapshot_minutes=snapshot_minutes)
        COUNT.require(snapshot_steps=snapshot_steps, log_every=log_every)
        self._began = time.monotonic()
        self.learning, self.data, self.trainer = learning, data, trainer
        self.output, self.folder = Path(output), Path(folder)
        self.snapshot_minutes, self.snapshot_steps = snapshot_minutes, snapshot_steps
        self.weights = f"{require_name(name, 'run.name')}.safetensors"
        if callbacks is None:
            callbacks = {"progress": ProgressBar(), "divergence": Divergence()}
        loggers = {"csv": LossTable()} if loggers is None else loggers
        self.callbacks = {name: item for name, item in callbacks.items() if item is not None}
        self.loggers = {name: item for name, item in loggers.items() if item is not None}
        self.log_every, self.fresh, self.half, self.lean = log_every, fresh, half, lean
        self.learning.may_change = self.may_change = tuple(may_change)

    def run(self) -> Mapping[str, Any]:
        """Trains until a limit of the trainer; returns steps, time, costs and the last scores.

        A training that is finished says so, and its weights are put into place again.

        Raises:
            CheckpointError: the folder holds a training of another network, with other data, losses
                or seeds.
            ConfigError: network, losses and data don't go together.
            StorageError: a folder can't be written.
            TrainingError: the training diverged, the GPU or a process of several failed.
        """
        self.learning.describe = self._facts
        self.learning.check(self.data)
        require_writable(self.output)
        require_writable(self.folder)
        for name in (self.weights, _TABLE):
            require_free(self.output / name)
        saved_state = self._saved_state()
        over = finished(self.trainer.budget, saved_state) if saved_state else None
        if saved_state and over:
            print(f"{over} ({self._state})", flush=True)
            return self._restore(saved_state)
        if self.trainer.endless:
            print(
                "this training has no limit: it goes on until Ctrl-C, which saves it "
                "(trainer.max_steps=N ends it)",
                flush=True,
            )
        with processes(self.trainer.processes if self.trainer.nodes == 1 else 1, self._fit):
            trainer = self._fit()
        if trainer.is_global_zero:
            self._collect()
        scores = {n: float(v) for n, v in trainer.callback_metrics.items()}
        costs = {f"train/{n}": v for n, v in self.learning.costs().items()}
        return self._figures() | costs | scores

    @property
    def _state(self) -> Path:
        return self.folder / _STATE

    def _saved_state(self) -> dict[str, Any] | None:
        """The state to resume from, if there is one."""
        if self.fresh or not self._state.exists():
            return None
        return state_to_go_on(
            self._state, self.learning.model.recipe, self._settings(), self.may_change
        )

    def _fit(self) -> Any:
        """The work of one process."""
        resumed = self._state.exists() and not self.fresh
        with Interruption() as interruption:
            trainer = self.trainer.build(self.folder, [interruption, *self._callbacks()])
            state = str(self._state) if resumed else None
            try:
                with self.trainer.faster(trainer.strategy.root_device):
                    trainer.fit(self.learning, self.data, ckpt_path=state)
            except SystemExit as stop:  # what Lightning makes of Ctrl-C
                if not isinstance(stop.__context__, KeyboardInterrupt):
                    raise
                raise type(stop.__context__)(self._resume_advice()) from stop
            except Exception as error:
                if not device_failed(error):
                    raise
                line = str(error).strip().partition("\n")[0]
                raise TrainingError(f"the GPU failed ({line}); {self._resume_advice()}") from error
        if interruption.number is not None:
            raise stop_of(interruption.number)(self._resume_advice())
        self.learning.times.finish()
        return trainer

    def _resume_advice(self) -> str:
        """Where a training that was stopped goes on."""
        if not self._state.exists():
            return "the training has no snapshot yet"
        steps = read_state(self._state, mapped=True)["scenefw"]["batches_seen"]
        command = "this command without run.fresh=true" if self.fresh else "the same command"
        status = f"the training is kept in {self._state}, at step {steps}"
        return f"{status}; {command}{self._place()} resumes it"

    def _place(self) -> str:
        """What to add to a command whose training lies in a folder that is named by the time."""
        words = read_record(self.output).get("command", [])
        is_named = not words or any(word.startswith("paths.output=") for word in words)
        if is_named or not self.folder.resolve().is_relative_to(self.output.resolve()):
            return ""
        sweep = {"-m", "--multirun"} & set(words)
        return f" with paths.output={self.output.parent if sweep else self.output}"

    def _restore(self, state: dict[str, Any]) -> Mapping[str, Any]:
        """The weights of a finished training, and its figures."""
        self.learning.on_load_checkpoint(state)
        self.learning.load_state_dict(state["state_dict"])
        if not (self.folder / self.weights).exists():
            self._export(state["scenefw"]["facts"])
        self._collect()
        return self._figures()

    def _callbacks(self) -> list[Any]:
        snapshots = Snapshots(self._state, self.snapshot_minutes, self.snapshot_steps, self._export)
        limits = self.trainer.limits(lambda: snapshots.seconds, self._began)
        recording = Recording(self.loggers, self.folder, self.log_every)
        # Snapshots come last, so that diverged weights are not saved
        return [limits, *self.callbacks.values(), recording, snapshots]

    def _export(self, facts: Mapping[str, Any] | None = None) -> None:
        """Writes the averaged weights into the folder of the training."""
        learning, model = self.learning, self.learning.model
        with learning.averaged():
            save_checkpoint(
                self.folder / self.weights,
                model,
                model.recipe,
                self.data.grid,
                dict(self._facts() if facts is None else facts),
                half=self.half,
                omit=model.training_only if self.lean else (),
                task=learning.task,
            )

    def _settings(self) -> dict[str, Any]:
        """What a training learns from and how: changes make it a different training."""
        return {**self.data.facts(), **self.learning.facts()}

    def _facts(self) -> dict[str, Any]:
        """Provenance of the weights, as plain data for their file."""
        learning, record = self.learning, read_record(self.output)
        words = {"command": command_line(record)} if record.get("command") is not None else {}
        commit = record.get("versions", {}).get("commit")
        return {
            "steps": learning.batches_seen,
            "samples": learning.samples_seen,
            "seconds": round(learning.seconds, 1),
            "epochs": round(learning.epochs_seen, 2),
            "device": learning.device.type,
            "precision": self.trainer.precision,
            **self._settings(),
            **words,
            **({"commit": commit} if commit else {}),
            **({"started_from": learning.started_from} if learning.started_from else {}),
        }

    def _collect(self) -> None:
        for name in (self.weights, _TABLE):
            if self.folder.resolve() != self.output.resolve() and (self.folder / name).exists():
                with replacing(self.output / name) as temporary:
                    shutil.copyfile(self.folder / name, temporary)
        print(self.output / self.weights)

    def _figures(self) -> dict[str, float]:
        return {
            "train/steps": float(self.learning.batches_seen),
            "train/seconds": self.learning.seconds,
            "train/parameters": float(sum(p.numel() for p in self.learning.model.parameters())),
        }
