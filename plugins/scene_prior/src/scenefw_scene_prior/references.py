"""What draws of whole scenes are compared with: references that learn nothing."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import torch
from scipy.spatial.transform import Rotation

from scenefw.core.batches import SceneParameters

if TYPE_CHECKING:
    from numpy.random import Generator


def shuffled(
    scenes: SceneParameters, count: int, random: Generator, objects: int | None = None
) -> SceneParameters:
    """Scenes whose parts are drawn one by one from those of others.

    The number of objects is of one scene; the shape and rotation of each object, and its position
    beside the middle of its scene, are of two other objects. So each number is distributed as it
    should be, and nothing fits together.

    Args:
        scenes: to draw from.
        count: of scenes.
        random: of the draws.
        objects: how many each scene has; None: drawn too.
    """
    present = scenes.present
    middle = _middle(scenes)
    positions = (scenes.positions - middle[:, None])[present]
    slots = present.shape[1]
    slots = slots if objects is None else objects
    numbers = present.sum(dim=1)[_draw(random, len(present), count)]
    numbers = numbers if objects is None else torch.full_like(numbers, objects)
    shapes, places = (_draw(random, len(positions), count * slots) for _ in range(2))
    fields = (scenes.half_axes, scenes.exponents, scenes.rotations)
    axes, exponents, rotations = (
        field[present][shapes].unflatten(0, (count, slots)) for field in fields
    )
    slot_mask = torch.arange(slots)[None] < numbers[:, None]
    return SceneParameters(
        axes, exponents, rotations, positions[places].unflatten(0, (count, slots)), slot_mask
    )


def jittered(
    scenes: SceneParameters, shift: float, turn: float, random: Generator
) -> SceneParameters:
    """Scenes whose objects are moved a little.

    Args:
        scenes: true ones.
        shift: standard deviation along each axis (m).
        turn: standard deviation of the angle about any axis (degrees).
        random: of the moves.
    """
    shape = scenes.present.shape
    moves = torch.from_numpy(random.normal(0.0, shift, (*shape, 3))).float()
    axes = random.normal(size=(*shape, 3))
    axes /= (axes**2).sum(axis=-1, keepdims=True) ** 0.5
    angles = random.normal(0.0, turn, (*shape, 1))
    turns = Rotation.from_rotvec((angles * axes).reshape(-1, 3), degrees=True).as_matrix()
    by = torch.from_numpy(turns).float().view(*shape, 3, 3)
    return replace(scenes, positions=scenes.positions + moves, rotations=by @ scenes.rotations)


def _middle(scenes: SceneParameters) -> torch.Tensor:
    """Middle (S, 3) of the centres of each scene, on the floor."""
    weights = scenes.present.float()[..., None]
    middle = (scenes.positions * weights).sum(dim=1) / weights.sum(dim=1).clamp_min(1)
    return middle * middle.new_tensor([1.0, 1.0, 0.0])


def _draw(random: Generator, of: int, count: int) -> torch.Tensor:
    return torch.from_numpy(random.integers(of, size=count))
