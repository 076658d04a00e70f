"""Training of shape-and-instance networks on views that are drawn anew every epoch."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from scenefw.core.batches import ShapeInstanceBatch
from scenefw.core.errors import ConfigError
from scenefw.core.protocols import Loss
from scenefw.core.rng import Streams, torch_seed
from scenefw.core.types import GridSpec
from scenefw.data.conditioning import training_batch
from scenefw.data.modules import IndexBatch
from scenefw.data.stacks import StackScenes
from scenefw.data.views import ViewMaker
from scenefw.learning.checkpoint import SHAPE_INSTANCE
from scenefw.learning.initial import start_from
from scenefw.learning.module import TrainingModule
from scenefw.learning.optimizers import Optimizer
from scenefw.learning.provenance import origin
from scenefw.learning.schedules import Schedule
from scenefw.learning.scores import sample_scores, scores
from scenefw.noise.frames import described

# Random streams, beside that of the order of scenes
_VIEWS, _VALIDATION, _CODES, _SAMPLES = 2, 3, 4, 5
_DRAWN = 3  # codes per view that a validation scores


class ShapeInstanceLearning(TrainingModule):
    """Trains a network from partial views to complete shape and votes (group `learning`).

    A step takes indices of scenes, computes their volumes and one view each on the training device,
    and sums the named losses times their weights. All randomness is a function of the seed and of
    numbers of epoch, scene and step, so that a resumed training goes on as if never stopped.

    Args:
        model: the network; its `channels` say whether it sees what was observed.
        losses: terms by name, each with a `weight`.
        views: makes volumes and views.
        learning_rate: of the optimiser at factor 1.
        weight_decay: of the optimiser; 0 makes AdamW Adam.
        schedule: factor of the learning rate; None means 0.99 every 5 epochs.
        average: decay of the moving average of weights that is validated and exported; 0: none.
        seed: seed of views and codes.
        initial: checkpoint whose weights to start from; None starts from random ones.
        reinitialise: modules of the network, such as decoder.linear, that start from random
            weights even so.
        draw_from: share of the schedule's budget from which codes of the prior are drawn. Before,
            zero takes their place, as samples of a network that knows little differ in all.
        channels_last: memory format of the network, faster on CPUs and on tensor cores.
        compile: let torch.compile make the network's training pass faster; a text names a backend.
        optimizer: how gradients change weights; None means AdamW.
    """

    task = SHAPE_INSTANCE

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
        initial: str | Path | None = None,
        reinitialise: Sequence[str] = (),
        draw_from: float = 0.0,
        *,
        channels_last: bool = True,
        compile: bool | str = False,  # noqa: A002 - as torch calls it
        optimizer: Optimizer | None = None,
    ) -> None:
        if not 0 <= draw_from <= 1:
            raise ConfigError(
                f"learning.draw_from is {draw_from}, expected a share of the budget from 0 to 1"
            )
        if initial is not None:
            start_from(model, initial, reinitialise=list(reinitialise))
        model = model.to(memory_format=torch.channels_last_3d) if channels_last else model
        super().__init__(
            model, learning_rate, weight_decay, schedule, average, seed, compile, optimizer
        )
        self.started_from = origin(initial) if initial is not None else None
        self.losses = dict(losses)
        self.views = views
        self.draw_from = draw_from

    @property
    def grid(self) -> GridSpec:
        """The voxel grid of the views."""
        return self.views.grid

    def facts(self) -> dict[str, Any]:
        """How it trains."""
        return {
            "optimizer": str(self.optimizer),
            "learning_rate": self.learning_rate,
            "losses": {name: loss.weight for name, loss in self.losses.items()},
            "noise": described(self.views.noise),
            "seed": self.seed,
        }

    def check(self, data: Any) -> None:
        """Finds out before the work whether network, losses and data go together.

        Raises:
            ConfigError: a loss compares two codes per view and none has two, or it doesn't fit the
                volume.
        """
        comparing = [name for name, loss in self.losses.items() if _of_draws(loss)]
        redraws = getattr(self.model, "redraws", None)
        if comparing and not (redraws and redraws(data.batch_size)):
            raise ConfigError(
                f"the loss {' and '.join(comparing)} needs two codes per view, and none of a batch "
                f"of {data.batch_size} has them; raise model.prior_share or the batch, or leave "
                "the loss out"
            )
        for loss in self.losses.values():
            if hasattr(loss, "check"):
                loss.check(self.grid.resolution)

    def training_step(self, batch: IndexBatch, batch_idx: int) -> Tensor:
        """The weighted sum of the losses of the next batch.

        The loader starts anew when a training is resumed within an epoch; so what is next follows
        from the number of batches seen.
        """
        batch = self.trainer.train_dataloader.batch(self.batches_seen)
        scenes = self.trainer.datamodule.scenes
        volumes = self.fetch(lambda: self._draw(scenes, batch, _VIEWS))
        codes = torch.Generator()  # on the CPU: the same codes on every device
        codes.manual_seed(torch_seed(self.seed, _CODES, self.batches_seen, self.global_rank))
        draw = self.budget_done >= self.draw_from
        prediction = self.model(volumes, codes, draw=draw)
        chosen = {n: loss for n, loss in self.losses.items() if draw or not _of_draws(loss)}
        terms = {name: loss(prediction, volumes) for name, loss in chosen.items()}
        total: Tensor = sum(self.losses[name].weight * term for name, term in terms.items())
        values = {f"train/{name}": term.detach() for name, term in terms.items()}
        self.log_dict({"train/total": total.detach(), **values}, batch_size=len(batch.indices))
        self.count_batch()
        return total

    def validation_step(self, batch: IndexBatch, batch_idx: int) -> None:
        """Scores predictions of the same views every time: of the zero code, and of drawn ones."""
        volumes = self._draw(self.trainer.datamodule.validation_scenes, batch, _VALIDATION)
        prediction = self.model.predict(volumes.condition)
        found = scores(prediction, volumes)
        if hasattr(self.model, "latent_size"):
            found |= sample_scores(self._samples(volumes, batch_idx), volumes.tsdf)
        values = {f"val/{name}": value for name, value in found.items()}
        self.log_dict(values, batch_size=len(batch.indices), on_epoch=True, sync_dist=True)

    def _samples(self, volumes: ShapeInstanceBatch, batch_idx: int) -> Tensor:
        """Distances (S, B, 1, X, Y, Z) of the same codes from N(0, I) each time."""
        views = len(volumes.tsdf)
        codes = torch.Generator().manual_seed(torch_seed(self.seed, _SAMPLES, batch_idx))
        latent = torch.randn((_DRAWN * views, self.model.latent_size), generator=codes)
        tsdf: Tensor = self.model.predict(volumes.condition, latent.to(self.device)).tsdf
        return tsdf.unflatten(0, (_DRAWN, views))

    @torch.no_grad()
    def _draw(self, scenes: StackScenes, batch: IndexBatch, stream: int) -> ShapeInstanceBatch:
        """Volumes and one view of each scene; scene i of epoch e depends on (seed, e, i) alone."""
        parameters = scenes.parameters(batch.indices, self.device)
        streams = Streams.of(self.seed, stream, batch.epoch, indices=batch.indices.numpy())
        with torch.autocast(self.device.type, enabled=False):
            made = self.views.make(parameters, streams)
        observed = self.model.channels == 2
        return training_batch(made.partial, made.volumes, self.views.grid, observed=observed)


def _of_draws(loss: Loss) -> bool:
    """Whether a loss compares drawn codes."""
    return getattr(loss, "of_draws", False)
