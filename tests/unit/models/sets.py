"""Batches of boxes for networks of sets."""

import torch

from scenefw.core.object_sets import ObjectSetBatch


def boxes(resolution=16, batch=2, most=3, seed=0):
    """Scene b has b + 1 boxes, at most `most`, that don't overlap; the rest is absent."""
    generator = torch.Generator().manual_seed(seed)
    instances = torch.zeros(batch, *(resolution,) * 3, dtype=torch.int32)
    present = torch.zeros(batch, most, dtype=torch.bool)
    centres = torch.zeros(batch, most, 3)
    wide = resolution // 4
    for scene in range(batch):
        for i in range(min(scene + 1, most)):
            low = torch.randint(0, resolution - wide, (3,), generator=generator)
            low[0] = i * (resolution // most)
            x, y, z = low.tolist()
            instances[scene, x : x + wide, y : y + wide, z : z + wide] = i + 1
            present[scene, i] = True
            centres[scene, i] = (low + wide / 2) * 2 / resolution - 1
    condition = torch.rand(batch, 2, *(resolution,) * 3, generator=generator) * 2 - 1
    return ObjectSetBatch(condition, instances, present, centres)
