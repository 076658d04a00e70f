"""Several depth images of one scene, as steps of a reconstruction see them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, reduce
from typing import TYPE_CHECKING, ClassVar, TypeAlias

import numpy as np
from scipy.ndimage import binary_erosion

from scenefw.core.batches import PartialTSDF
from scenefw.mapping.several_views import require_agreement
from scenefw.perception.observation.observation import JointGeometry, Observation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from scenefw.core.types import Float64, Frame, GridSpec

    Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Views:
    """Observations of one scene in one cube; together they are one image, one below the other.

    Args:
        observations: with poses in the world of the cube.
        T_views_input: (4, 4) from coordinates of the poses as they were given to those of the cube.
        warnings: what looks wrong, one line each.
        table: where it is, in words.
    """

    observations: tuple[Observation, ...]
    T_views_input: Float64 = field(default_factory=lambda: np.eye(4))
    warnings: tuple[str, ...] = ()
    table: str = "the plane z = 0 of the poses"

    masks: ClassVar[None] = None
    eye: ClassVar[None] = None
    mixed: ClassVar[None] = None

    @classmethod
    def of_partials(cls, partials: Sequence[PartialTSDF], grid: GridSpec) -> Views:
        """Views of a scene whose floor is known to be z = 0.

        Args:
            partials: batches of one.
            grid: of all.

        Raises:
            InputError: no view, or views that contradict each other.
        """
        require_agreement(partials, grid)
        return cls(tuple(Observation.of_partial(partial, grid) for partial in partials))

    @property
    def grid(self) -> GridSpec:
        """Of volumes."""
        return self.observations[0].grid

    @property
    def frame(self) -> Frame:
        """The first image."""
        return self.observations[0].frame

    @cached_property
    def partial(self) -> PartialTSDF:
        """What all views show of the grid; without an image, unless there is one view."""
        return reduce(PartialTSDF.merge, [view.partial for view in self.observations])

    @cached_property
    def points(self) -> Float64:
        """(V H, W, 3) world coordinates of the pixels (m), NaN = no depth."""
        return np.concatenate([view.points for view in self.observations])

    @cached_property
    def free(self) -> Mask:
        """(X, Y, Z) voxels that any view shows to be free, by more than a voxel."""
        return np.asarray(np.any([view.free for view in self.observations], axis=0))

    @cached_property
    def clear(self) -> Mask:
        """(X, Y, Z) free voxels whose neighbours are free."""
        return np.asarray(binary_erosion(self.free))

    @cached_property
    def cameras(self) -> tuple[JointGeometry, ...]:
        """Each view by itself, with the free space of all."""
        return tuple(
            JointGeometry(view.points, self.grid, self.free, view.eye, view.mixed)
            for view in self.observations
        )


View: TypeAlias = Observation | Views
"""What steps see: one depth image, or several of one scene."""
