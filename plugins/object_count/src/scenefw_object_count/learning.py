"""The training: what differs from any other is the prediction and what is validated."""

from torch import Tensor

from scenefw.core.batches import IndexBatch
from scenefw.core.errors import ConfigError
from scenefw.learning.module import TrainingModule
from scenefw_object_count.batches import CountBatch, CountSetup
from scenefw_object_count.data import CountedScenes
from scenefw_object_count.log_score import LogScore
from scenefw_object_count.network import CountNetwork


class CountLearning(TrainingModule):
    """Trains a network to count (group `learning`); arguments are those of any training."""

    task = "object_count"
    model: CountNetwork

    def setup_with(self, data: CountedScenes) -> CountSetup:
        """The numbers of objects.

        Raises:
            ConfigError: the data have scenes of more than the network knows.
        """
        if data.most > self.model.most:
            raise ConfigError(
                f"the network counts up to {self.model.most}, the data have {data.most} objects in "
                f"a scene; give model.most={data.most}"
            )
        return CountSetup(self.model.most)

    def predict_batch(self, batch: CountBatch) -> Tensor:
        """Scores (B, most)."""
        scores: Tensor = self.model(batch.condition)
        return scores

    def validation_step(self, batch: IndexBatch, batch_idx: int) -> None:
        """Scores predictions of the same views every time."""
        views = self.validation_batch(batch)
        scores = self.model(views.condition)
        right = scores.argmax(dim=1) + 1 == views.counts
        values = {
            "val/log_score": LogScore()(scores, views),
            "val/accuracy": right.float().mean(),
        }
        self.log_dict(values, batch_size=len(views.counts), on_epoch=True, sync_dist=True)
