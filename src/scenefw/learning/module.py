"""What all trainings share: the step, the losses, and the initial weights."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any, get_type_hints

import torch
from torch import Tensor, nn

from scenefw.core.batches import IndexBatch
from scenefw.core.errors import ConfigError
from scenefw.core.training_protocols import Loss, Network
from scenefw.kernels.precision import full_precision
from scenefw.learning.costs import SideStream
from scenefw.learning.initial import start_from
from scenefw.learning.optimizers import Optimizer
from scenefw.learning.provenance import origin
from scenefw.learning.resumable import ResumableModule
from scenefw.learning.schedules import Schedule


class TrainingModule(ResumableModule, ABC):
    """A training that resumes after a kill as if never stopped; subclasses say what is predicted.

    A step takes the next batch from the data module, predicts, and sums the losses times their
    weights. It depends on the weights, on `batches_seen` and on seeds alone. Further arguments are
    those of `ResumableModule`.

    Args:
        losses: terms by name.
        seed: of codes and dropout.
        initial: weights to start from; None: random ones.
        reinitialise: modules of the network that start from random weights even so.
        channels_last: keep weights of convolutions channels last in memory, which is fast.

    Raises:
        ConfigError: no loss, or no such module to reinitialise.
        CheckpointError: the initial weights are of another network.
    """

    task: str
    """What the network is for, as checkpoints name it."""

    def __init__(
        self,
        model: Network,
        losses: Mapping[str, Loss],
        learning_rate: float,
        weight_decay: float = 0.01,
        schedule: Schedule | None = None,
        average: float = 0.998,
        seed: int = 0,
        initial: str | Path | None = None,
        reinitialise: Sequence[str] = (),
        *,
        channels_last: bool = True,
        compile: bool | str = False,  # noqa: A002 - as torch calls it
        optimizer: Optimizer | None = None,
    ) -> None:
        if not losses:
            raise ConfigError("no loss to train with; give loss=[NAME,...] (--list shows them)")
        if initial is not None:
            start_from(model, initial, self.task, reinitialise)
        network = _laid_out(model) if channels_last else model
        super().__init__(
            network, learning_rate, weight_decay, schedule, average, compile, optimizer
        )
        self.started_from = origin(initial) if initial is not None else None
        self.losses, self.seed = dict(losses), seed
        self._compiled: dict[str, Callable[..., Tensor]] = {}
        self._side = SideStream()

    @abstractmethod
    def predict_batch(self, batch: Any) -> Any:
        """The network's training pass on a batch of the data module."""

    @abstractmethod
    def setup_with(self, data: Any) -> Any:
        """What losses may check before the work.

        Raises:
            ConfigError: network and data don't go together.
        """

    def check(self, data: Any) -> None:
        """Checks before the work that network, losses and data fit together.

        Raises:
            ConfigError: they don't.
        """
        setup: Any = self.setup_with(data)
        for name, loss in self.losses.items():
            _require_setup(name, loss, setup)
            loss.check(setup)

    def facts(self) -> dict[str, Any]:
        """Facts about the training, as plain data for the checkpoint's metadata."""
        return {
            "optimizer": str(self.optimizer),
            "learning_rate": self.learning_rate,
            "losses": {name: loss.weight for name, loss in self.losses.items()},
            "seed": self.seed,
        }

    def on_fit_start(self) -> None:
        """Compiles the losses, too."""
        super().on_fit_start()
        if self.compiled:
            self._compiled = {
                name: torch.compile(loss.__call__, backend=self.backend)
                for name, loss in self.losses.items()
            }

    def losses_now(self) -> Mapping[str, Loss]:
        """The losses that count in this step."""
        return self.losses

    def training_step(self, batch: IndexBatch, batch_idx: int) -> Tensor:
        """The weighted sum of the losses of the next batch.

        The loader starts again when a training is resumed within an epoch; so what is next follows
        from the number of samples seen.
        """
        batch = self.trainer.train_dataloader.batch(self.batch_number)
        training_batch = self._side.run(self.device, lambda: self._training_batch(batch))
        self.times.mark_data(self.device)
        prediction = self.predict_batch(training_batch)
        terms = {
            name: self._compiled.get(name, loss)(prediction, training_batch)
            for name, loss in self.losses_now().items()
        }
        total: Tensor = sum(self.losses[name].weight * term for name, term in terms.items())
        values = {f"train/{name}": term.detach() for name, term in terms.items()}
        self.log_dict({"train/total": total.detach(), **values}, batch_size=len(batch.indices))
        self.count_batch()
        return total

    @full_precision()
    def _training_batch(self, batch: IndexBatch) -> Any:
        return self.trainer.datamodule.training_batch(batch, self.device)

    @full_precision()
    def validation_batch(self, batch: IndexBatch) -> Any:
        """The validation samples of the data module; coordinates keep their precision."""
        return self.trainer.datamodule.validation_batch(batch, self.device)


def _require_setup(name: str, loss: Loss, setup: Any) -> None:
    """Refuses a loss that is written for another kind of training, by what its `check` takes."""
    try:
        hints = get_type_hints(loss.check)
    except NameError:  # imported for type checkers only
        return
    setup_type = next((kind for word, kind in hints.items() if word != "return"), None)
    if (
        isinstance(setup_type, type)
        and is_dataclass(setup_type)
        and not isinstance(setup, setup_type)
    ):
        raise ConfigError(
            f"the loss {name} is for trainings that give it a {setup_type.__name__}, this one "
            f"gives a {type(setup).__name__}; choose others by loss=[...]"
        )


def _laid_out(model: nn.Module) -> nn.Module:
    """The network with weights of four and five dimensions, convolutions', channels last."""
    formats = {4: torch.channels_last, 5: torch.channels_last_3d}
    for weights in model.parameters():
        if weights.ndim in formats:
            weights.data = weights.data.contiguous(memory_format=formats[weights.ndim])
    return model
