"""Quick scores of predicted volumes, to watch a training; evaluation proper is elsewhere."""

import torch
from torch import Tensor

from scenefw.core.types import ShapeInstanceBatch, ShapeInstancePrediction


def scores(prediction: ShapeInstancePrediction, batch: ShapeInstanceBatch) -> dict[str, Tensor]:
    """Occupancy IoU, mean TSDF error (truncations), mean vote error inside objects (degrees)."""
    predicted, truth = prediction.tsdf.float() < 0, batch.tsdf < 0
    union = (predicted | truth).sum().clamp(min=1)
    votes = torch.nn.functional.normalize(prediction.votes.float(), dim=1)
    cosine = (votes * batch.votes).sum(dim=1).clamp(-1, 1)
    inside = batch.votes.square().sum(dim=1) > 0.5
    angle = torch.rad2deg(cosine.acos()) * inside
    return {
        "iou": (predicted & truth).sum() / union,
        "tsdf": (prediction.tsdf.float().clamp(-1, 1) - batch.tsdf).abs().mean(),
        "vote_degrees": angle.sum() / inside.sum().clamp(min=1),
    }
