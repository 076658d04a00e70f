"""Training of networks that see a scene as a set of objects."""

import dataclasses

import torch
from torch import Tensor

from scenefw.core.batches import IndexBatch
from scenefw.core.errors import ConfigError
from scenefw.core.object_sets import ObjectSetBatch, ObjectSetPrediction, ObjectSetSetup
from scenefw.core.rng import torch_seed
from scenefw.core.training_protocols import ObjectSetData, ObjectSetModel
from scenefw.kernels.precision import distances
from scenefw.learning.checkpoint import OBJECT_SETS
from scenefw.learning.module import TrainingModule
from scenefw.losses.set_bce import SetBinaryCrossEntropy
from scenefw.matching.object_sets import matched_objects
from scenefw.metrics.decomposition import decomposition_scores

_CODES = 4  # random stream, beside those of data


class ObjectSetLearning(TrainingModule):
    """Trains a network to decompose scenes (group `learning`); arguments are those of any training.

    Predictions are matched to true objects once per step, before all losses.
    """

    task = OBJECT_SETS
    model: ObjectSetModel

    def setup_with(self, data: ObjectSetData) -> ObjectSetSetup:
        """Grid, number of predictions, and what the network gives.

        Raises:
            ConfigError: scenes have more objects than the network predicts, or another grid.
        """
        if data.most > self.model.slots:
            raise ConfigError(
                f"the network predicts {self.model.slots} objects, the data have up to {data.most} "
                f"in a scene; give model.slots={data.most}"
            )
        if data.grid.resolution != self.model.resolution:
            raise ConfigError(
                f"the network is for {self.model.resolution} voxels per side, the grid has "
                f"{data.grid.resolution}; give model.resolution=${{grid.resolution}}"
            )
        return ObjectSetSetup(data.grid, self.model.slots, frozenset(self.model.gives))

    def predict_batch(self, batch: ObjectSetBatch) -> ObjectSetPrediction:
        """The training pass with the draws of this step, matched to true objects."""
        draws = torch.Generator()  # on the CPU: the same on every device
        draws.manual_seed(torch_seed(self.seed, _CODES, self.batches_seen, self.global_rank))
        return matched(self.model(batch, draws), batch)

    def validation_step(self, batch: IndexBatch, batch_idx: int) -> None:
        """Scores predictions of the same views every time; nothing is drawn."""
        validation_batch = self.validation_batch(batch)
        prediction = matched(self.model(validation_batch), validation_batch)
        values = {
            "val/set_bce": SetBinaryCrossEntropy()(prediction, validation_batch),
            **_scores(prediction, validation_batch),
        }
        self.log_dict(values, batch_size=len(batch.indices), on_epoch=True, sync_dist=True)


def matched(prediction: ObjectSetPrediction, batch: ObjectSetBatch) -> ObjectSetPrediction:
    """The prediction with the true object that each of its objects stands for."""
    centre_distances = None
    if prediction.boxes is not None:
        centre_distances = distances(prediction.boxes[..., 0, :], batch.centres)
    objects = matched_objects(
        prediction.logits, batch.instances, batch.present, centre_distances=centre_distances
    )
    return dataclasses.replace(prediction, matched=objects)


def _scores(prediction: ObjectSetPrediction, batch: ObjectSetBatch) -> dict[str, Tensor]:
    """Object IoU, and shares of scenes with errors.

    Any voxel above 1/2 makes an object, unless a score says that it doesn't exist.
    """
    inside = prediction.logits > 0
    if prediction.existence is not None:
        inside = inside & (prediction.existence > 0)[..., None, None, None]
    rows = []
    for masks, labels, present in zip(inside, batch.instances, batch.present, strict=True):
        objects = torch.arange(len(present), device=labels.device)[present] + 1
        true = (labels[None] == objects[:, None, None, None]).cpu().numpy()
        mine = masks.cpu().numpy()
        scores = decomposition_scores(mine[mine.any(axis=(1, 2, 3))], true)
        errors = (scores.missing + scores.joined > 0, scores.duplicate + scores.split > 0)
        rows.append([scores.object_iou, *map(float, errors)])
    means = torch.tensor(rows, device=batch.instances.device).mean(dim=0)
    names = ("val/object_iou", "val/missing_or_joined", "val/duplicate_or_split")
    return dict(zip(names, means, strict=True))
