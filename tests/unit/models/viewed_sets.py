"""Views of sets of superquadrics, by chance."""

import torch

from scenefw.core.set_flows import SetFlowBatch


def rotations(*shape, seed=0):
    random = torch.Generator().manual_seed(seed)
    q, _ = torch.linalg.qr(torch.randn(*shape, 3, 3, generator=random))
    return q * torch.linalg.det(q)[..., None, None]


def ends_of(points, seen):
    """Some of the points, with free space behind them."""
    outward = torch.nn.functional.normalize(points[:, :, :5], dim=-1)
    ends = torch.cat([points[:, :, :5], outward, torch.full((*seen.shape, 5, 1), 0.1)], dim=-1)
    return ends * seen[..., None, None]


def batch_of(views=2, objects=3, seed=0):
    random = torch.Generator().manual_seed(seed)

    def uniform(low, high, *shape):
        return low + (high - low) * torch.rand(*shape, generator=random)

    seen = torch.ones(views, objects, dtype=torch.bool)
    seen[0, -1] = False
    points = uniform(-0.2, 0.2, views, objects, 8, 3) * seen[..., None, None]
    return SetFlowBatch(
        points, seen, 0.02 * seen, ends_of(points, seen),
        torch.tensor([[-0.8, 0.0, 0.5]]).expand(views, 3),
        uniform(0.03, 0.1, views, objects, 3), uniform(2, 30, views, objects, 3),
        rotations(views, objects), uniform(-0.2, 0.2, views, objects, 3),
        torch.ones(views, objects, dtype=torch.bool),
    )  # fmt: skip
