"""Scenes of superquadrics left to gravity: how they move, and those that stand."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import torch

from scenefw.core import geometry
from scenefw.core.batches import SceneParameters
from scenefw.core.types import PlacedShape, Pose, SceneObject
from scenefw.shapes.superquadric import Superquadric
from scenefw_scene_prior.pushing_apart import pushed_apart
from scenefw_simulators.motions import motions

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from scenefw.core.protocols import Engine
    from scenefw_simulators.motions import Motion

_DENSITY = 500.0  # kg/m^3


@dataclass(frozen=True)
class Gravity:
    """Lets scenes fall. A pile stands if no object moves or turns too far until all rest.

    Args:
        engine: simulates.
        steps: of each simulation at most.
        furthest: of centres (m).
        steepest: of turns (degrees).
    """

    engine: Engine
    steps: int
    furthest: float
    steepest: float

    def motions(self, scene: Sequence[SceneObject]) -> list[Motion]:
        """Motion of each object until everything rests."""
        return motions(scene, self.engine, self.steps, until_rest=True)

    def stands(self, object_motions: Sequence[Motion]) -> bool:
        """Whether a pile with these motions stands; one without objects doesn't."""
        return bool(object_motions) and all(
            motion.shift < self.furthest and motion.turn < self.steepest
            for motion in object_motions
        )

    def at_rest(
        self,
        draw: Callable[[int, int], SceneParameters],
        counts: Sequence[int],
        attempts: int = 20,
    ) -> SceneParameters:
        """Scenes pushed apart and left to gravity until they rest; those that fall are drawn anew.

        Args:
            draw: makes scenes: how many, and of how many objects each.
            counts: objects of each scene that is wanted.
            attempts: draws of a scene; after the last one it is as it came to lie.
        """
        scenes: list[SceneParameters] = []
        for count in sorted(set(counts)):
            remaining_scenes = list(counts).count(count)
            for remaining_attempts in reversed(range(attempts)):
                candidates = separate_objects(draw(remaining_scenes, count))
                for row in range(len(candidates.present)):
                    object_motions = self.motions(objects_of(candidates, row))
                    if self.stands(object_motions) or not remaining_attempts:
                        scenes.append(
                            _apply_motions(select_scenes(candidates, [row]), object_motions)
                        )
                        remaining_scenes -= 1
                if not remaining_scenes:
                    break
        return concatenate_scenes(scenes)


def objects_of(scenes: SceneParameters, row: int) -> tuple[SceneObject, ...]:
    """The objects of one scene as rigid bodies."""
    present = scenes.present[row].cpu().numpy()
    fields = (scenes.half_axes, scenes.exponents, scenes.rotations, scenes.positions)
    axes, exponents, rotations, positions = (
        field[row].double().cpu().numpy()[present] for field in fields
    )
    items = []
    for i in range(len(axes)):
        shape = Superquadric(axes[i], exponents[i])
        pose = Pose(positions[i], geometry.quaternion_from_rotation(rotations[i]))
        items.append(SceneObject(shape, pose, _DENSITY * shape.volume()))
    return tuple(items)


def separate_objects(scenes: SceneParameters) -> SceneParameters:
    """The scenes with objects pushed out of each other and out of the floor."""
    positions = scenes.positions.clone()
    for row in range(len(positions)):
        placed = [PlacedShape(item.shape, item.pose) for item in objects_of(scenes, row)]
        centres = [shape.pose.position for shape in pushed_apart(placed)]
        if centres:
            present = scenes.present[row]
            positions[row, present] = torch.from_numpy(np.array(centres)).to(positions)
    return replace(scenes, positions=positions)


def _apply_motions(scene: SceneParameters, object_motions: Sequence[Motion]) -> SceneParameters:
    """One scene with objects where they ended."""
    positions, rotations = scene.positions.clone(), scene.rotations.clone()
    for slot, motion in zip(scene.present[0].nonzero()[:, 0].tolist(), object_motions, strict=True):
        positions[0, slot] = torch.from_numpy(motion.pose.position).to(positions)
        rotations[0, slot] = torch.from_numpy(motion.pose.rotation).to(rotations)
    return replace(scene, positions=positions, rotations=rotations)


def select_scenes(scenes: SceneParameters, rows: Sequence[int]) -> SceneParameters:
    """Some of the scenes, in this order; rows that don't exist are left out."""
    indices = [row for row in rows if row < len(scenes.present)]
    return SceneParameters(*(field[indices] for field in vars(scenes).values()))


def concatenate_scenes(parts: Sequence[SceneParameters]) -> SceneParameters:
    """Scenes one after the other; absent objects fill up those that have fewer."""
    slots = max(part.present.shape[1] for part in parts)
    padded = []
    for part in parts:
        extra = slots - part.present.shape[1]
        fields = {}
        for name, field in vars(part).items():
            filler = field.new_zeros(len(field), extra, *field.shape[2:])
            if name in ("half_axes", "exponents"):
                filler = filler + 2.0
            fields[name] = torch.cat([field, filler], dim=1)
        padded.append(replace(part, **fields))
    return SceneParameters(
        *(torch.cat([getattr(scenes, name) for scenes in padded]) for name in vars(padded[0]))
    )
