"""Settings of Lightning's trainer that a training may change (group `trainer`)."""

import logging
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import lightning
from lightning.fabric.utilities.exceptions import MisconfigurationException

from scenefw.core.errors import ConfigError


class TrainerSettings:
    """How long, on what and how precisely to train.

    Args:
        accelerator: cpu, cuda, cuda:1 or auto.
        devices: how many, or auto.
        precision: Lightning's name: 32-true, bf16-mixed or 16-mixed.
        max_epochs: stop after this many passes over the training scenes; -1 means never.
        max_steps: stop after this many steps; -1 means never.
        max_time: stop after this time of training, DD:HH:MM:SS, resumptions counted in; None
            means never.
        validate_every: steps between validations; None means once per epoch; 0 means never.
        gradient_clip: largest norm of the gradient; None means no limit.
        accumulate: batches per optimiser step.
        nodes: machines.
    """

    def __init__(
        self,
        accelerator: str = "auto",
        devices: int | str | list[int] = "auto",
        precision: str = "32-true",
        max_epochs: int = 130,
        max_steps: int = -1,
        max_time: str | None = None,
        validate_every: int | None = None,
        gradient_clip: float | None = 1.0,
        accumulate: int = 1,
        nodes: int = 1,
    ) -> None:
        self.max_epochs, self.max_steps, self.max_time = max_epochs, max_steps, max_time
        self.validate_every = validate_every
        accelerator, _, number = accelerator.partition(":")
        if number:  # one device by its number, e.g. cuda:1
            devices = [int(number)]
        self._options: dict[str, Any] = {
            "accelerator": accelerator,
            "devices": devices if accelerator != "cpu" else 1,
            "precision": precision,
            "gradient_clip_val": gradient_clip,
            "accumulate_grad_batches": accumulate,
            "num_nodes": nodes,
        }

    def build(
        self, folder: Path, callbacks: Sequence[lightning.Callback], **options: Any
    ) -> lightning.Trainer:
        """The trainer; checkpoints, logs and progress are left to the callbacks.

        Raises:
            ConfigError: the settings contradict each other or the machine.
        """
        settings: dict[str, Any] = {
            "max_epochs": self.max_epochs,
            "max_steps": self.max_steps,
            "max_time": self.max_time,
            "limit_val_batches": 0 if self.validate_every == 0 else None,
            "val_check_interval": self.validate_every or None,
            "check_val_every_n_epoch": None if self.validate_every else 1,
            "num_sanity_val_steps": 0,
            "logger": False,
            "enable_checkpointing": False,
            "enable_progress_bar": False,
            "enable_model_summary": False,
            "use_distributed_sampler": False,
            "default_root_dir": str(folder),
        }
        logging.getLogger("lightning.pytorch").setLevel(logging.WARNING)
        for quiet in ("num_workers", "weights_only", "LeafSpec", "dataloader is not resumable"):
            warnings.filterwarnings("ignore", message=f".*{quiet}.*")
        try:
            return lightning.Trainer(
                callbacks=list(callbacks), **self._options, **settings, **options
            )
        except (ValueError, RuntimeError, MisconfigurationException) as error:
            line = " ".join(str(error).split())
            raise ConfigError(f"the trainer's settings are unusable: {line} (trainer.*)") from error
