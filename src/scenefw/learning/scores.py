"""Quick scores of predicted volumes, to watch a training; evaluation proper is elsewhere."""

import torch
from torch import Tensor

from scenefw.core.batches import ShapeInstanceBatch, ShapeInstancePrediction


def scores(prediction: ShapeInstancePrediction, batch: ShapeInstanceBatch) -> dict[str, Tensor]:
    """Occupancy IoU, mean TSDF error (truncations), mean vote error inside objects (degrees)."""
    votes = torch.nn.functional.normalize(prediction.votes.float(), dim=1)
    cosine = (votes * batch.votes).sum(dim=1).clamp(-1, 1)
    inside = batch.votes.square().sum(dim=1) > 0.5
    angle = torch.rad2deg(cosine.acos()) * inside
    return {
        "iou": _iou(prediction.tsdf < 0, batch.tsdf < 0),
        "tsdf": (prediction.tsdf.float().clamp(-1, 1) - batch.tsdf).abs().mean(),
        "vote_degrees": angle.sum() / inside.sum().clamp(min=1),
    }


def sample_scores(samples: Tensor, truth: Tensor) -> dict[str, Tensor]:
    """What several drawn codes are worth: mean occupancy IoU, BCE of their expected occupancy.

    If the samples do not differ, the BCE is 100 nats for each wrong voxel.

    Args:
        samples: (S, B, 1, X, Y, Z) signed distances.
        truth: (B, 1, X, Y, Z).
    """
    expected, occupied = (samples < 0).float().mean(dim=0), truth < 0
    # written out: autocast on CUDA has no binary_cross_entropy of probabilities
    logs = torch.where(occupied, expected, 1 - expected).log().clamp(min=-100)
    return {
        "sample_iou": torch.stack([_iou(sample < 0, truth < 0) for sample in samples]).mean(),
        "sample_bce": -logs.mean(),
    }


def _iou(predicted: Tensor, truth: Tensor) -> Tensor:
    return (predicted & truth).sum() / (predicted | truth).sum().clamp(min=1)
