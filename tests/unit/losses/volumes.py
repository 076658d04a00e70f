"""Random batches and predictions for the losses."""

import numpy as np
import torch

from scenefw.core.batches import ShapeInstanceBatch, ShapeInstancePrediction


def random_pair(resolution=4, batch=3, latent=5, seed=0):
    rng = np.random.default_rng(seed)
    size = (resolution,) * 3

    def draw(*shape, low=-1.0, high=1.0):
        return torch.from_numpy(rng.uniform(low, high, shape))

    truth = draw(batch, 1, *size, low=-1.3, high=1.3).clamp(-1, 1)
    condition = torch.cat([draw(batch, 1, *size), draw(batch, 1, *size).round()], dim=1)
    votes = torch.nn.functional.normalize(draw(batch, 3, *size), dim=1) * (truth < 0)
    prediction = ShapeInstancePrediction(
        {
            "tsdf": draw(batch, 1, *size, low=-1.5, high=1.5).requires_grad_(),
            "votes": draw(batch, 3, *size).requires_grad_(),
        },
        draw(batch, 1, *size, low=-1.5, high=1.5).requires_grad_(),
        draw(batch, latent, low=-2, high=2).requires_grad_(),
        {
            "mean": draw(batch, latent).requires_grad_(),
            "log_variance": draw(batch, latent).requires_grad_(),
        },
    )
    return prediction, ShapeInstanceBatch(condition, {"tsdf": truth, "votes": votes})
