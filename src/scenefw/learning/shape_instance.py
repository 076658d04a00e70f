"""Training of shape-and-instance networks on views that are drawn anew every epoch."""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from typing import Any

import lightning
import torch
from torch import Tensor, nn

from scenefw.core.protocols import Loss
from scenefw.core.rng import generator, torch_seed
from scenefw.core.types import ShapeInstanceBatch
from scenefw.data.conditioning import training_batch
from scenefw.data.modules import IndexBatch
from scenefw.data.stacks import StackScenes
from scenefw.data.views import ViewMaker
from scenefw.learning.averaging import AveragedWeights
from scenefw.learning.schedules import Progress, Schedule, StepDecay
from scenefw.learning.scores import scores

_VIEWS, _VALIDATION, _CODES = 2, 3, 4  # random streams, beside that of the order of scenes


class ShapeInstanceLearning(lightning.LightningModule):
    """Trains a network from partial views to complete shape and votes (group `learning`).

    A step takes indices of scenes, computes their volumes and one view each on the training device,
    and sums the named losses times their weights. All randomness is a function of the seed and of
    numbers of epoch, scene and step, so that a resumed training goes on as if never stopped.

    Args:
        model: the network; its `channels` say whether it sees what was observed.
        losses: terms by name, each with a `weight`.
        views: makes volumes and views.
        learning_rate: of AdamW at factor 1.
        weight_decay: of AdamW; 0 makes it Adam.
        schedule: factor of the learning rate; None means 0.99 every 5 epochs.
        average: decay of the moving average of weights that is validated and exported; 0: none.
        seed: seed of views and codes.
        channels_last: memory format of the network, faster on CPUs and on tensor cores.
    """

    def __init__(
        self,
        model: nn.Module,
        losses: Mapping[str, Loss],
        views: ViewMaker,
        learning_rate: float = 1e-3,
        weight_decay: float = 0.0,
        schedule: Schedule | None = None,
        average: float = 0.998,
        seed: int = 0,
        *,
        channels_last: bool = True,
    ) -> None:
        super().__init__()
        self.model = model.to(memory_format=torch.channels_last_3d) if channels_last else model
        self.losses = dict(losses)
        self.views = views
        self.learning_rate, self.weight_decay = learning_rate, weight_decay
        self.schedule = schedule or StepDecay()
        self.seed = seed
        self.average = AveragedWeights(model, average) if average else None
        self.batches_seen, self.seconds = 0, 0.0
        self._began = time.monotonic()

    def configure_optimizers(self) -> torch.optim.Optimizer:
        """AdamW, which is Adam where `weight_decay` is 0."""
        return torch.optim.AdamW(
            self.model.parameters(), lr=self.learning_rate, weight_decay=self.weight_decay
        )

    def on_fit_start(self) -> None:
        """Brings the averaged weights to the training device."""
        if self.average is not None:
            self.average.to(self.device)

    def on_train_batch_start(self, batch: IndexBatch, batch_idx: int) -> None:
        """Sets the learning rate of this step."""
        self._began = time.monotonic()
        epoch = self.batches_seen // len(self.trainer.train_dataloader)
        if self.trainer.world_size > 1:  # one clock, else learning rates drift apart
            self.seconds = self.trainer.strategy.broadcast(self.seconds)
        progress = Progress(self.batches_seen, epoch, self.seconds)
        for group in self.optimizers().param_groups:  # type: ignore[union-attr]
            group["lr"] = self.learning_rate * self.schedule.factor(progress)

    def training_step(self, batch: IndexBatch, batch_idx: int) -> Tensor:
        """The weighted sum of the losses of the next batch.

        The loader starts anew when a training is resumed within an epoch; so what is next follows
        from the number of batches seen.
        """
        batch = self.trainer.train_dataloader.batch(self.batches_seen)
        volumes = self._draw(self.trainer.datamodule.scenes, batch, _VIEWS)
        codes = torch.Generator()  # on the CPU: the same codes on every device
        codes.manual_seed(torch_seed(self.seed, _CODES, self.batches_seen, self.global_rank))
        prediction = self.model(volumes, codes)
        terms = {name: loss(prediction, volumes) for name, loss in self.losses.items()}
        total: Tensor = sum(self.losses[name].weight * term for name, term in terms.items())
        values = {f"train/{name}": term.detach() for name, term in terms.items()}
        self.log_dict({"train/total": total.detach(), **values}, batch_size=len(batch.indices))
        self.batches_seen += 1
        self._count_time()
        return total

    def optimizer_step(self, *arguments: Any, **options: Any) -> None:
        """Steps, then averages the weights, before callbacks see the end of the batch."""
        super().optimizer_step(*arguments, **options)
        if self.average is not None:
            self.average.update(self.model)
        self._count_time()

    def _count_time(self) -> None:
        now = time.monotonic()
        self.seconds += now - self._began
        self._began = now

    def on_validation_epoch_start(self) -> None:
        """Validates the averaged weights."""
        self._swap = self.averaged()
        self._swap.__enter__()

    def on_validation_epoch_end(self) -> None:
        """Goes back to the weights that are trained."""
        self._swap.__exit__(None, None, None)

    def validation_step(self, batch: IndexBatch, batch_idx: int) -> None:
        """Scores the zero-code prediction of the same views every time."""
        volumes = self._draw(self.trainer.datamodule.validation_scenes, batch, _VALIDATION)
        prediction = self.model.predict(volumes.condition)
        values = {f"val/{name}": value for name, value in scores(prediction, volumes).items()}
        self.log_dict(values, batch_size=len(batch.indices), on_epoch=True, sync_dist=True)

    @contextmanager
    def averaged(self) -> Iterator[None]:
        """The network holds the averaged weights meanwhile."""
        with self.average.swapped(self.model) if self.average is not None else nullcontext():
            yield

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Keeps where the training is."""
        checkpoint["scenefw"] = {
            "recipe": self.model.recipe,
            "batches_seen": self.batches_seen,
            "seconds": self.seconds,
            "average": self.average.state_dict() if self.average is not None else None,
        }

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Goes on from there."""
        state = checkpoint["scenefw"]
        self.batches_seen, self.seconds = state["batches_seen"], state["seconds"]
        if self.average is not None and state["average"] is not None:
            self.average.load_state_dict(state["average"])

    @torch.no_grad()
    def _draw(self, scenes: StackScenes, batch: IndexBatch, stream: int) -> ShapeInstanceBatch:
        """Volumes and one view of each scene; scene i of epoch e depends on (seed, e, i) alone."""
        parameters = scenes.parameters(batch.indices, self.device)
        streams = [generator(self.seed, stream, batch.epoch, int(index)) for index in batch.indices]
        with torch.autocast(self.device.type, enabled=False):
            made = self.views.make(parameters, streams)
        observed = self.model.channels == 2
        return training_batch(made.partial, made.volumes, self.views.grid, observed=observed)
