"""Training of flows between noise and sets of superquadrics."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch

from scenefw.core.batches import IndexBatch
from scenefw.core.errors import ConfigError
from scenefw.core.rng import torch_seed
from scenefw.core.set_flows import SetFlowBatch, SetFlowPrediction, SetFlowSetup
from scenefw.learning.checkpoint import SET_FLOW
from scenefw.learning.module import TrainingModule

if TYPE_CHECKING:
    from scenefw.core.training_protocols import SetFlowData, SetFlowModel

_NOISE = 5  # random stream, beside those of data
_REPEATS = 4


class SetFlowLearning(TrainingModule):
    """Trains a flow of sets (group `learning`); arguments are those of any training."""

    task = SET_FLOW
    model: SetFlowModel

    def setup_with(self, data: SetFlowData) -> SetFlowSetup:
        """The number of slots, and what is drawn.

        Raises:
            ConfigError: scenes have more objects than the network has slots.
        """
        if data.most > self.model.slots:
            raise ConfigError(
                f"the network has {self.model.slots} slots, the data have up to {data.most} "
                f"objects in a scene; give model.slots={data.most}"
            )
        return SetFlowSetup(self.model.slots, self.model.draws_hidden)

    def predict_batch(self, batch: SetFlowBatch) -> SetFlowPrediction:
        """The training pass with the noise of this step."""
        draws = torch.Generator()  # on the CPU: the same on every device
        draws.manual_seed(torch_seed(self.seed, _NOISE, self.batches_seen, self.global_rank))
        return self.model(batch, draws)

    def validation_step(self, batch: IndexBatch, batch_idx: int) -> None:
        """The losses with the same views, noise and times every time."""
        validation_batch = self.validation_batch(batch)
        draws = torch.Generator().manual_seed(torch_seed(self.seed, _NOISE, 2**32 + batch_idx))
        totals = dict.fromkeys(self.losses, 0.0)
        for _ in range(_REPEATS):
            prediction = self.model(validation_batch, draws)
            for name, loss in self.losses.items():
                totals[name] += float(loss(prediction, validation_batch)) / _REPEATS
        values = {f"val/{name}": value for name, value in totals.items()}
        self.log_dict(values, batch_size=len(batch.indices), on_epoch=True, sync_dist=True)
