"""What scenes of superquadrics and of meshes share: volumes that are computed once."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import fields
from typing import TYPE_CHECKING, Any, Generic, Self, TypeVar

if TYPE_CHECKING:
    from torch import Tensor

    from scenefw.core.batches import CameraBatch, SceneVolumes
    from scenefw.core.types import GridSpec

Parameters = TypeVar("Parameters")


class KnownScenes(ABC, Generic[Parameters]):
    """B scenes whose volumes several representations share, computed in one pass.

    Args:
        parameters: the scenes.
        grid: the voxel grid, world frame.
        volumes: of the scenes, if they are known.
    """

    def __init__(
        self, parameters: Parameters, grid: GridSpec, volumes: SceneVolumes | None = None
    ) -> None:
        self.parameters, self.grid, self._volumes = parameters, grid, volumes

    @property
    def volumes(self) -> SceneVolumes:
        """Exact distances, votes and instances, computed when first read."""
        if self._volumes is None:
            self._volumes = self.computed()
        return self._volumes

    def chosen(self, rows: Tensor) -> Self:
        """Some of the scenes, by their numbers (N,), with their volumes."""
        return type(self)(self.parameters_of(rows), self.grid, rows_of(self.volumes, rows))

    @abstractmethod
    def computed(self) -> SceneVolumes:
        """Exact distances, votes and instances."""

    @abstractmethod
    def parameters_of(self, rows: Tensor) -> Parameters:
        """Parameters of some of the scenes, by their numbers (N,)."""

    @abstractmethod
    def depth(self, cameras: CameraBatch) -> Tensor:
        """Z-depth (B, H, W) in metres of the shapes themselves, without floor; 0 = nothing hit."""


def rows_of(tensors: Any, rows: Tensor) -> Any:
    """Some rows of a dataclass of tensors, by their numbers (N,)."""
    return type(tensors)(*(getattr(tensors, field.name)[rows] for field in fields(tensors)))
