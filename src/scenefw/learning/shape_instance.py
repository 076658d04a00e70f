"""Training of shape-and-instance networks on views that are drawn again every epoch."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from scenefw.core.batches import (
    IndexBatch,
    ShapeInstanceBatch,
    ShapeInstancePrediction,
    ShapeInstanceSetup,
)
from scenefw.core.errors import ConfigError
from scenefw.core.rng import torch_seed
from scenefw.core.settings import SHARE
from scenefw.core.training_protocols import (
    Loss,
    ShapeInstanceData,
    ShapeInstanceLoss,
    ShapeInstanceModel,
    VolumeMetric,
)
from scenefw.learning.checkpoint import SHAPE_INSTANCE
from scenefw.learning.module import TrainingModule
from scenefw.learning.optimizers import Optimizer
from scenefw.learning.schedules import Schedule

# Random streams, beside those of data
_CODES, _SAMPLES = 4, 5
_SAMPLE_COUNT = 3  # codes per view that a validation scores


class ShapeInstanceLearning(TrainingModule):
    """Trains a network from partial views to complete volumes (group `learning`).

    Further arguments are those of any training.

    Args:
        metrics: figures of a validation by name; None: none.
        reinitialise: modules of the network, such as decoder.linear, that start from random weights
            even so.
        draw_from: share of the schedule's budget from which codes of the prior are drawn. Before,
            zero takes their place, as samples of a network that knows little differ in all.
    """

    task = SHAPE_INSTANCE
    model: ShapeInstanceModel

    def __init__(
        self,
        model: ShapeInstanceModel,
        losses: Mapping[str, ShapeInstanceLoss],
        metrics: Mapping[str, VolumeMetric] | None = None,
        learning_rate: float = 1e-3,
        weight_decay: float = 0.0,
        schedule: Schedule | None = None,
        average: float = 0.998,
        seed: int = 0,
        initial: str | Path | None = None,
        reinitialise: Sequence[str] = (),
        draw_from: float = 0.0,
        *,
        channels_last: bool = True,
        compile: bool | str = False,  # noqa: A002 - as torch calls it
        optimizer: Optimizer | None = None,
    ) -> None:
        SHARE.require(draw_from=draw_from)
        super().__init__(
            model, losses, learning_rate, weight_decay, schedule, average, seed, initial,
            reinitialise, channels_last=channels_last, compile=compile, optimizer=optimizer,
        )  # fmt: skip
        self.metrics = dict(metrics or {})
        self.draw_from = draw_from

    def setup_with(self, data: ShapeInstanceData) -> ShapeInstanceSetup:
        """Grid, volumes, and how many views have two codes.

        Raises:
            ConfigError: the network's outputs are not the volumes of the data.
        """
        channels = {
            name: representation.channels for name, representation in data.representations.items()
        }
        if dict(self.model.outputs) != channels:
            raise ConfigError(
                f"the network gives {_listed(self.model.outputs)}, but is to be trained on "
                f"{_listed(channels)}; give a network with these outputs, or "
                f"representation=[{','.join(self.model.outputs)}]"
            )
        redrawn = self.model.redraws(data.batch_size)
        return ShapeInstanceSetup(data.grid, channels, data.batch_size, redrawn)

    def check(self, data: Any) -> None:
        """Checks before the work that network, losses, metrics and data fit together.

        Raises:
            ConfigError: they don't.
        """
        super().check(data)
        for metric in self.metrics.values():
            metric.check(self.setup_with(data))

    def losses_now(self) -> Mapping[str, Loss]:
        """Leaves out losses that compare drawn codes until codes are drawn."""
        return {n: loss for n, loss in self.losses.items() if self._draw or not loss.needs_draws}

    def predict_batch(self, batch: ShapeInstanceBatch) -> ShapeInstancePrediction:
        """The training pass, with the codes of this step."""
        codes = torch.Generator()  # on the CPU: the same codes on every device
        codes.manual_seed(torch_seed(self.seed, _CODES, self.batches_seen, self.global_rank))
        return self.model(batch, codes, draw=self._draw)

    @property
    def _draw(self) -> bool:
        return self.budget_done >= self.draw_from

    def validation_step(self, batch: IndexBatch, batch_idx: int) -> None:
        """Scores predictions of the same views every time: of the zero code, and of drawn ones."""
        validation_batch = self.validation_batch(batch)
        grid = self.trainer.datamodule.grid
        predicted = {False: self._volumes(self.model.predict(validation_batch.condition))}
        if any(metric.of_samples for metric in self.metrics.values()):
            predicted[True] = self._samples(validation_batch.condition, batch_idx)
        values = {
            f"val/{name}": metric(predicted[metric.of_samples], validation_batch.truths, grid)
            for name, metric in self.metrics.items()
        }
        self.log_dict(values, batch_size=len(batch.indices), on_epoch=True, sync_dist=True)

    def _samples(self, condition: Tensor, batch_idx: int) -> dict[str, Tensor]:
        """Volumes (S, B, C, X, Y, Z) of the same codes from N(0, I) each time; S = 1 without."""
        views = len(condition)
        if not self.model.latent_size:
            volumes = self._volumes(self.model.predict(condition))
            return {name: volume[None] for name, volume in volumes.items()}
        codes = torch.Generator().manual_seed(torch_seed(self.seed, _SAMPLES, batch_idx))
        latent = torch.randn((_SAMPLE_COUNT * views, self.model.latent_size), generator=codes)
        volumes = self._volumes(self.model.predict(condition, latent.to(self.device)))
        return {
            name: volume.unflatten(0, (_SAMPLE_COUNT, views)) for name, volume in volumes.items()
        }

    def _volumes(self, prediction: ShapeInstancePrediction) -> dict[str, Tensor]:
        """In the units of their representations."""
        data = self.trainer.datamodule
        return {
            name: representation.from_network(prediction.volumes[name], data.grid)
            for name, representation in data.representations.items()
        }


def _listed(channels: Mapping[str, int]) -> str:
    return ", ".join(f"{name} ({count} channels)" for name, count in channels.items())
