"""The data module of stacks: views and volumes, made on the device that trains."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from scenefw.core.batches import IndexBatch, ShapeInstanceBatch
from scenefw.core.errors import ConfigError
from scenefw.core.protocols import Representation
from scenefw.core.types import GridSpec
from scenefw.data.batches.conditioning import shape_instance_batch
from scenefw.data.batches.scene_batches import SceneBatches
from scenefw.data.batches.stacks import StackScenes
from scenefw.data.batches.views import ViewMaker
from scenefw.noise.frames import described
from scenefw.representations.tsdf import TSDF
from scenefw.representations.vote_field import VoteField

# Random streams, beside that of the order of scenes
_VIEWS, _VALIDATION, _COUNTS = 2, 3, 4


class StackData(SceneBatches):
    """Makes views of the scenes of two splits and their volumes (group `dataset`).

    No volume is ever stored. View and motion of scene i in epoch e depend on (seed, e, i) alone.
    Further arguments are those of `SceneBatches`.

    Args:
        views: moves scenes and makes a view of each.
        representations: volumes that the network learns to give, by name; None: tsdf and votes.
        counts: numbers of views, of which one is drawn for each training scene; more than one are
            fused. Validation scenes are seen once.

    Raises:
        ConfigError: no representation, or numbers of views below 1.
    """

    def __init__(
        self,
        views: ViewMaker,
        representations: Mapping[str, Representation] | None = None,
        path: str | Sequence[str] | None = None,
        limit: int | None = None,
        validation_limit: int | None = 64,
        batch_size: int = 8,
        seed: int = 0,
        distinct_batches: int | None = None,
        counts: Sequence[int] = (1,),
    ) -> None:
        super().__init__(path, limit, validation_limit, batch_size, seed, distinct_batches)
        if representations is not None and not representations:
            raise ConfigError("no volume to train on; give representation=[tsdf,votes]")
        if not counts or min(counts) < 1:
            raise ConfigError(
                f"dataset.counts is {list(counts)}; expected numbers of views, 1 or more"
            )
        self.counts = np.array(counts)
        self.views = views
        standard: dict[str, Representation] = {"tsdf": TSDF(), "votes": VoteField()}
        self.representations = dict(representations or standard)

    @property
    def grid(self) -> GridSpec:
        """The voxel grid of views and volumes."""
        return self.views.grid

    @property
    def noise_words(self) -> str | list[str]:
        """What disturbs the views."""
        return described(self.views.noise)

    def facts(self) -> dict[str, Any]:
        """Facts about the training data."""
        several = self.counts.tolist() if self.counts.max() > 1 else None
        return {**super().facts(), **({"views_of_a_scene": several} if several else {})}

    def training_batch(self, batch: IndexBatch, device: torch.device) -> ShapeInstanceBatch:
        """Views and volumes of scenes in an epoch."""
        streams = self.streams(batch, _COUNTS)
        counts = self.counts[(streams.uniform(1)[:, 0] * len(self.counts)).astype(int)]
        return self._make(self.scenes, batch, device, _VIEWS, counts)

    def validation_batch(self, batch: IndexBatch, device: torch.device) -> ShapeInstanceBatch:
        """The same views every time, with volumes in the units of the representations too."""
        return self._make(self.validation_scenes, batch, device, _VALIDATION, truths=True)

    @torch.no_grad()
    def _make(
        self,
        scenes: StackScenes,
        batch: IndexBatch,
        device: torch.device,
        stream: int,
        counts: NDArray[np.int64] | None = None,
        *,
        truths: bool = False,
    ) -> ShapeInstanceBatch:
        parameters = scenes.parameters(batch.indices, device)
        streams = self.streams(batch, stream)
        views = self.views.make(parameters, streams, counts)
        return shape_instance_batch(
            views.partial, views.scenes, self.representations, truths=truths
        )
