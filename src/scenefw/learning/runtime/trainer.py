"""Settings of Lightning's trainer that a training may change (group `trainer`)."""

import logging
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import lightning
import torch
from lightning.fabric.utilities.exceptions import MisconfigurationException

from scenefw.core.errors import ConfigError
from scenefw.core.settings import COUNT, NOT_NEGATIVE
from scenefw.learning.runtime.limits import Budget, Limits, seconds_of
from scenefw.learning.runtime.state import StateFiles
from scenefw.learning.schedules import limit

_QUIET = (
    "num_workers",
    "weights_only",
    "LeafSpec",
    "dataloader is not resumable",
    "callbacks used to create",  # states of earlier versions had a timer
    "Grad strides do not match",
    "sync_dist=True",  # counts of all processes are added up before they are logged
)


class TrainerSettings:
    """Duration, device and precision of a training.

    Args:
        accelerator: cpu, cuda, cuda:1 or auto.
        devices: how many, each with a process of its own; auto takes all GPUs, or one CPU process.
        precision: Lightning's name: 32-true, bf16-mixed or 16-mixed; auto: bf16-mixed where the
            device has instructions for it, else 32-true.
        max_epochs: end after this many passes over the training data; None or -1 means never.
        max_steps: end after this many steps; None or -1 means never.
        max_minutes: end after this time of training, all calls together; None or -1 means never.
        max_time: stop this call, state saved, before it has taken this time, DD:HH:MM:SS; the next
            call resumes it. None means never.
        validate_every: steps between validations; None means once per epoch; 0 means never.
        gradient_clip: largest norm of the gradient; None means no limit.
        nodes: machines.
        tf32: on CUDA, let float32 products round their factors to 10 bits, many times faster.
        benchmark: on CUDA, time the ways to do each convolution once, and take the fastest.

    Raises:
        ConfigError: a limit of 0, a number out of range, or a time that is none.
    """

    def __init__(
        self,
        accelerator: str,
        devices: int | str | list[int] = "auto",
        precision: str = "32-true",
        max_epochs: int | None = 130,
        max_steps: int | None = -1,
        max_minutes: float | None = None,
        max_time: str | None = None,
        validate_every: int | None = None,
        gradient_clip: float | None = 1.0,
        nodes: int = 1,
        *,
        tf32: bool = True,
        benchmark: bool = True,
    ) -> None:
        self.budget = Budget(
            limit(max_steps, "max_steps"),
            limit(max_epochs, "max_epochs"),
            limit(max_minutes, "max_minutes"),
        )
        NOT_NEGATIVE.require(validate_every=validate_every, gradient_clip=gradient_clip)
        COUNT.require(nodes=nodes)
        self.call = seconds_of(max_time)
        self.validate_every, self.tf32, self.benchmark = validate_every, tf32, benchmark
        accelerator, _, number = accelerator.partition(":")
        if number:  # one device by its number, e.g. cuda:1
            devices = [int(number)]
        self._options: dict[str, Any] = {
            "accelerator": accelerator,
            "devices": 1 if accelerator == "cpu" and devices == "auto" else devices,
            "precision": precision,
            "gradient_clip_val": gradient_clip,
            "num_nodes": nodes,
        }

    @property
    def endless(self) -> bool:
        """Whether nothing ends a training but whoever stops it."""
        return self.budget == Budget() and self.call is None

    @property
    def precision(self) -> str:
        """Lightning's name of it."""
        named = str(self._options["precision"])
        if named != "auto":
            return named
        on_gpu = self._options["accelerator"] != "cpu" and torch.cuda.is_available()
        fast = torch.cuda.is_bf16_supported() if on_gpu else _multiplies_bfloat16()
        return "bf16-mixed" if fast else "32-true"

    @property
    def processes(self) -> int:
        """Processes on this machine.

        Raises:
            ConfigError: `devices` says nothing usable.
        """
        devices, on_gpu = self._options["devices"], self._options["accelerator"] != "cpu"
        if isinstance(devices, list):
            return len(devices)
        if devices == "auto" or (on_gpu and str(devices) == "-1"):
            return max(torch.cuda.device_count(), 1) if on_gpu else 1
        try:
            count = int(devices)
        except ValueError:
            count = 0
        if count < 1:
            raise ConfigError(f"trainer.devices={devices}: expected a number, or auto")
        return count

    @property
    def nodes(self) -> int:
        """Machines."""
        return int(self._options["num_nodes"])

    def limits(self, saving: Callable[[], float], began: float) -> Limits:
        """What stops the training and the current call, begun at a time of `time.monotonic`."""
        return Limits(self.budget, self.call, saving, began=began)

    def build(
        self, folder: Path, callbacks: Sequence[lightning.Callback], **options: Any
    ) -> lightning.Trainer:
        """The trainer; limits, checkpoints, logs and progress are left to the callbacks.

        Raises:
            ConfigError: the settings contradict each other or the machine.
        """
        settings: dict[str, Any] = {
            "max_epochs": -1,
            "strategy": "ddp" if self.processes * self.nodes > 1 else "auto",
            "limit_val_batches": 0 if self.validate_every == 0 else None,
            "val_check_interval": self.validate_every or None,
            "check_val_every_n_epoch": None if self.validate_every else 1,
            "num_sanity_val_steps": 0,
            "logger": False,
            "enable_checkpointing": False,
            "enable_progress_bar": False,
            "enable_model_summary": False,
            "use_distributed_sampler": False,
            "plugins": [StateFiles()],
            "default_root_dir": str(folder),
        }
        logging.getLogger("lightning.pytorch").setLevel(logging.WARNING)
        for quiet in _QUIET:
            warnings.filterwarnings("ignore", message=f".*{quiet}.*")
        if self._options["accelerator"] in ("cuda", "gpu") and not torch.cuda.is_available():
            raise ConfigError(
                f"trainer.accelerator={self._options['accelerator']} but torch sees no GPU; give "
                "trainer=default and device=cpu, or install torch for this GPU"
            )
        try:
            trainer = lightning.Trainer(
                callbacks=list(callbacks),
                **{**self._options, "precision": self.precision},
                **settings,
                **options,
            )
        except (ValueError, RuntimeError, MisconfigurationException) as error:
            line = " ".join(str(error).split())
            raise ConfigError(f"the trainer's settings are invalid: {line} (trainer.*)") from error
        kind = trainer.strategy.root_device.type
        if kind == "cpu" and self.precision.startswith("bf16") and not _multiplies_bfloat16():
            print(
                f"warning: this CPU has no bfloat16 instructions, so trainer.precision="
                f"{self.precision} takes tens of times as long as trainer.precision=32-true",
                file=sys.stderr,
                flush=True,
            )
        return trainer

    @contextmanager
    def faster(self, device: torch.device) -> Iterator[None]:
        """Within the block, networks on CUDA take the shortcuts of `tf32` and `benchmark`.

        They hold for a whole process, and what follows a training measures geometry.
        """
        if device.type != "cuda":
            yield
            return
        cudnn = torch.backends.cudnn
        before = torch.get_float32_matmul_precision(), cudnn.allow_tf32, cudnn.benchmark
        torch.set_float32_matmul_precision("high" if self.tf32 else "highest")
        cudnn.allow_tf32, cudnn.benchmark = self.tf32, self.benchmark
        try:
            yield
        finally:
            torch.set_float32_matmul_precision(before[0])
            cudnn.allow_tf32, cudnn.benchmark = before[1:]


def _multiplies_bfloat16() -> bool:
    """Whether products of bfloat16 run in instructions of this CPU."""
    if not torch.backends.mkldnn.is_available():
        return False
    return torch.cpu._is_avx512_bf16_supported() or torch.cpu._is_amx_tile_supported()


def device_failed(error: Exception) -> bool:
    """Whether torch or numba say that a GPU is gone or broke down; later calls to it fail, too."""
    return isinstance(error, torch.AcceleratorError) or type(error).__name__ == "CudaAPIError"
