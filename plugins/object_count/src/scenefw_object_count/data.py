"""The data module: views of scenes and how many objects are there."""

from collections.abc import Sequence
from typing import Any

import lightning
import torch

from scenefw.core.batches import IndexBatch
from scenefw.core.rng import Streams
from scenefw.core.types import GridSpec
from scenefw.data.batches.conditioning import condition
from scenefw.data.batches.stacks import StackScenes
from scenefw.data.batches.views import ViewMaker
from scenefw.data.epochs import EpochBatches
from scenefw.noise.frames import described
from scenefw_object_count.batches import CountBatch

# Random streams, beside that of the order of scenes
_VIEWS, _VALIDATION = 2, 3


class CountedScenes(lightning.LightningDataModule):
    """Makes a new view of each scene in each epoch (group `dataset`).

    Args:
        views: moves scenes and makes a view of each.
        path: the `.npz` of a data set, the name of a shipped one (stacks, scattered), or several.
        limit: at most this many training scenes; None means all.
        validation_limit: at most this many validation scenes; None means all.
        batch_size: scenes per step.
        seed: of the order of scenes, and of views.
    """

    def __init__(
        self,
        views: ViewMaker,
        path: str | Sequence[str] | None = "scattered_v1",
        limit: int | None = None,
        validation_limit: int | None = 64,
        batch_size: int = 16,
        seed: int = 0,
    ) -> None:
        super().__init__()
        self.views, self.batch_size, self.seed = views, batch_size, seed
        self.scenes = StackScenes(path, "train", limit)
        self.validation_scenes = StackScenes(path, "val", validation_limit)

    @property
    def grid(self) -> GridSpec:
        """The voxel grid of views."""
        return self.views.grid

    @property
    def most(self) -> int:
        """The largest number of objects in a scene."""
        return max(int(counts(s).max()) for s in (self.scenes, self.validation_scenes))

    def facts(self) -> dict[str, Any]:
        """What a network learns from."""
        return {
            "data": self.scenes.sizes,
            "scenes": len(self.scenes),
            "validation_scenes": len(self.validation_scenes),
            "batch_size": self.batch_size,
            "noise": described(self.views.noise),
        }

    def train_dataloader(self) -> EpochBatches:
        """Shuffled batches."""
        return EpochBatches(len(self.scenes), self.batch_size, self.seed, *self._processes())

    def val_dataloader(self) -> EpochBatches:
        """The same batches every time."""
        return EpochBatches(len(self.validation_scenes), self.batch_size, None, *self._processes())

    def training_batch(self, batch: IndexBatch, device: torch.device) -> CountBatch:
        """Views of an epoch, each a function of (seed, epoch, index) alone."""
        return self._make(self.scenes, batch, device, _VIEWS)

    def validation_batch(self, batch: IndexBatch, device: torch.device) -> CountBatch:
        """The same views in every epoch."""
        return self._make(self.validation_scenes, batch, device, _VALIDATION)

    @torch.no_grad()
    def _make(
        self, scenes: StackScenes, batch: IndexBatch, device: torch.device, stream: int
    ) -> CountBatch:
        parameters = scenes.parameters(batch.indices, device)
        streams = Streams.of(self.seed, stream, batch.epoch, indices=batch.indices.numpy())
        with torch.autocast(torch.device(device).type, enabled=False):
            partial = self.views.make(parameters, streams).partial
            return CountBatch(condition(partial, self.grid), parameters.present.sum(dim=1))

    def _processes(self) -> tuple[int, int]:
        trainer = self.trainer
        return (trainer.global_rank, trainer.world_size) if trainer is not None else (0, 1)


def counts(scenes: StackScenes) -> torch.Tensor:
    """Objects (N,) int64 in each of N scenes."""
    return scenes.parameters(list(range(len(scenes)))).present.sum(dim=1)
