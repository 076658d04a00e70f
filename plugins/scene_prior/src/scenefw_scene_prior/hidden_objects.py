"""Objects of which a view shows nothing, drawn beside those that it shows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch

from scenefw.core.errors import ConfigError
from scenefw.fitting.placed import in_frame_of, shape_of
from scenefw.perception.observation.free_space import free_ratio, places_in

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.random import Generator

    from scenefw.core.evidence import FittedSuperquadric
    from scenefw.core.training_protocols import Trained
    from scenefw.perception.completion.extent_inputs import ExtentInputs
    from scenefw.perception.observation.observation import ViewGeometry
    from scenefw_scene_prior.protocols import WholeSetFlowModel

_MAX_FREE_RATIO = 0.05  # share of a hidden object that may lie in free space
_MAX_OVERLAP_RATIO = 0.2  # share of a hidden object that may lie in others


class HiddenObjects:
    """Draws objects that the view hides wholly, given those that it shows.

    A flow of whole sets draws how many there are, and then what they are, with seen objects held
    where they are known to be. It knows no free space. So draws are rejected in which an object
    lies where the view sees through, outside the grid or in another object, and the first that
    remains is taken; if none does, one object fewer is tried, and so on. (If numbers were drawn
    anew with each try, draws of many objects would be rejected more often than draws of few.)

    Args:
        checkpoint: of a flow of whole sets (`model=set_flow`).
        tries: draws for each number of objects.
        steps: of each draw.

    Raises:
        ConfigError: a number below one, or a network that draws nothing hidden.
    """

    def __init__(
        self, checkpoint: Trained[WholeSetFlowModel], tries: int = 8, steps: int = 20
    ) -> None:
        if min(tries, steps) < 1:
            raise ConfigError(f"hidden objects have tries {tries} and steps {steps}; expected >= 1")
        if not checkpoint.model.draws_hidden:
            raise ConfigError(
                "these weights draw no hidden objects; give checkpoints.set_flow=FILE of a "
                "training of model=set_flow, or completion=set_extents"
            )
        self.model, self.tries, self.steps = checkpoint.model, tries, steps

    @torch.no_grad()
    def beside(
        self,
        superquadrics: Sequence[FittedSuperquadric],
        seen_objects: ExtentInputs,
        view: ViewGeometry,
        random: Generator,
    ) -> list[FittedSuperquadric]:
        """Hidden objects of one scene, often none.

        Args:
            superquadrics: the seen objects, one for each of `seen_objects`.
            seen_objects: what the view shows of them.
            view: with seen free space.
            random: for the draws.
        """
        generator = torch.Generator().manual_seed(int(random.integers(2**62)))
        device = next(self.model.parameters()).device  # type: ignore[attr-defined]
        batch = seen_objects.batch(superquadrics, device)
        for number in range(self.model.hidden_number(batch, generator), 0, -1):
            samples = self.model.complete(batch, self.tries, number, generator, self.steps)
            world_sets = seen_objects.in_world(samples)
            for row in range(self.tries):
                hidden = world_sets.objects(row, first=len(superquadrics))
                if possible(hidden, view, superquadrics):
                    return hidden
        return []


def possible(
    hidden: Sequence[FittedSuperquadric],
    view: ViewGeometry,
    neighbours: Sequence[FittedSuperquadric],
) -> bool:
    """Whether objects lie neither where the view shows free space nor in other objects.

    Args:
        hidden: the objects.
        view: with seen free space, and the grid outside which there is nothing.
        neighbours: objects beside which they are.
    """
    obstacles = list(neighbours)
    for superquadric in hidden:
        places = places_in(superquadric)
        if not view.grid.nearest_voxels(places)[1].all():
            return False
        if free_ratio(places, view.free, view.grid) > _MAX_FREE_RATIO:
            return False
        inside_masks = [
            shape_of(obstacle).value(in_frame_of(obstacle, places)) < 1 for obstacle in obstacles
        ]
        if inside_masks and np.any(inside_masks, axis=0).mean() > _MAX_OVERLAP_RATIO:
            return False
        obstacles.append(superquadric)
    return True
