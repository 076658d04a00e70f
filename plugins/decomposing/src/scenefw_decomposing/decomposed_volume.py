"""Objects of the volumes on which networks of sets are evaluated."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenefw.evaluation.sets.methods import FoundSet, SeenSet, of_instances

if TYPE_CHECKING:
    from scenefw_decomposing.all_sides import AllSides


class DecomposedVolume:
    """Objects of the true TSDF of the whole scene, which says more than its occupancy does.

    Args:
        method: takes it apart.
    """

    grid = None  # it takes any

    def __init__(self, method: AllSides) -> None:
        self.method = method

    def decompose(self, scene: SeenSet) -> FoundSet:
        """The objects of one scene."""
        completion = self.method.decompose(scene.tsdf, scene.grid, scene.draws)
        return of_instances(completion.instances[0])
