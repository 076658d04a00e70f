"""The data module of sets: views and the objects of scenes, made on the device that trains."""

from collections.abc import Sequence

import torch

from scenefw.core.batches import IndexBatch
from scenefw.core.object_sets import ObjectSetBatch
from scenefw.core.types import GridSpec
from scenefw.data.batches.conditioning import condition
from scenefw.data.batches.scene_batches import SceneBatches
from scenefw.data.batches.stacks import StackScenes
from scenefw.data.batches.views import ViewBatch, ViewMaker
from scenefw.noise.frames import described

# Random streams, beside that of the order of scenes
_VIEWS, _VALIDATION = 2, 3


class ObjectSetViews(SceneBatches):
    """Makes views of the scenes of two splits and says which voxel is whose (group `dataset`).

    No volume is ever stored. View and motion of scene i in epoch e depend on (seed, e, i) alone.
    Further arguments are those of `SceneBatches`.

    Args:
        views: moves scenes and makes a view of each.
    """

    def __init__(
        self,
        views: ViewMaker,
        path: str | Sequence[str] | None = None,
        limit: int | None = None,
        validation_limit: int | None = 64,
        batch_size: int = 8,
        seed: int = 0,
        distinct_batches: int | None = None,
    ) -> None:
        super().__init__(path, limit, validation_limit, batch_size, seed, distinct_batches)
        self.views = views

    @property
    def grid(self) -> GridSpec:
        """The voxel grid of views and objects."""
        return self.views.grid

    @property
    def noise_words(self) -> str | list[str]:
        """What disturbs the views."""
        return described(self.views.noise)

    def training_batch(self, batch: IndexBatch, device: torch.device) -> ObjectSetBatch:
        """Views and objects of scenes in an epoch."""
        return self._make(self.scenes, batch, device, _VIEWS)

    def validation_batch(self, batch: IndexBatch, device: torch.device) -> ObjectSetBatch:
        """The same views every time."""
        return self._make(self.validation_scenes, batch, device, _VALIDATION)

    @torch.no_grad()
    def _make(
        self, scenes: StackScenes, batch: IndexBatch, device: torch.device, stream: int
    ) -> ObjectSetBatch:
        parameters = scenes.parameters(batch.indices, device)
        streams = self.streams(batch, stream)
        return object_set_batch(self.views.make(parameters, streams), self.grid)


def object_set_batch(views: ViewBatch, grid: GridSpec) -> ObjectSetBatch:
    """Views as networks of sets take them, and the objects of their scenes.

    A voxel belongs to the object in which it lies deepest, so objects share none.
    """
    instances, parameters = views.volumes.instances, views.superquadrics
    batch, slots = parameters.present.shape
    present = torch.zeros(batch, slots + 1, dtype=torch.bool, device=instances.device)
    present.scatter_(1, instances.flatten(1).long(), value=True)
    lower = torch.tensor(grid.lower, device=instances.device)
    centres = (parameters.positions - lower) * (2 / grid.extent) - 1
    return ObjectSetBatch(condition(views.partial, grid), instances, present[:, 1:], centres)
