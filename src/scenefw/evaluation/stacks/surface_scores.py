"""Distances between predicted and true surfaces, visible and full, with their sampling floors."""

from dataclasses import dataclass

import numpy as np
from torch import Tensor

from scenefw.core.errors import InputError
from scenefw.core.types import Camera, Float64, GridSpec, TriangleMesh
from scenefw.evaluation.stacks.visibility import VisibleSurface, visible_share
from scenefw.metrics.sampling import SurfacePoints, face_areas, sample_surface
from scenefw.metrics.surface import chamfer, chamfer_of, f_score, nearest, normal_consistency
from scenefw.postprocessing.surfaces import surface


@dataclass(frozen=True)
class Surfaces:
    """The surface of a scene and the part of it that the camera sees (None if there is none)."""

    full: TriangleMesh
    visible: TriangleMesh | None

    @classmethod
    def of(
        cls, tsdf: Tensor, grid: GridSpec, camera: Camera, visibility: VisibleSurface
    ) -> "Surfaces | None":
        """Surfaces of a TSDF (X, Y, Z) in metres; None if nothing is inside."""
        full = surface(tsdf, grid)
        if full is None:
            return None
        visible = visibility.part(full, tsdf, grid, camera)
        return cls(full, visible if face_areas(visible).sum() > 0 else None)


@dataclass(frozen=True)
class TruePoints:
    """Points on the true surface of one view, drawn once for all methods.

    Args:
        visible: (1000, 3) metres.
        full: (1000, 3) metres.
        dense: 30 000 points with normals on the full surface.
        visibility: visible area over full area.
        floors: Chamfer distances to a second drawing from the same surface.
    """

    visible: np.ndarray
    full: np.ndarray
    dense: SurfacePoints
    visibility: float
    floors: dict[str, float]


@dataclass(eq=False)
class SurfaceScoring:
    """Chamfer distances from few points, as in the thesis, and measures from many.

    Args:
        points: on each surface for the Chamfer distances of table 5.1.
        dense_points: on each surface for the dense Chamfer distance, F-score and normals.
        threshold: of the F-score (m).
        absent: distance that counts where a method shows no surface at all (m).
    """

    points: int = 1000
    dense_points: int = 30000
    threshold: float = 0.01
    absent: float = 1.0

    @property
    def f_score_name(self) -> str:
        """E.g. fscore_1cm."""
        return f"fscore_{self.threshold * 100:g}cm"

    def truth(self, surfaces: Surfaces | None, rng: np.random.Generator) -> TruePoints:
        """Points on the true surfaces of a view.

        Raises:
            InputError: nothing of the scene is visible.
        """
        if surfaces is None or surfaces.visible is None:
            raise InputError(
                "the camera sees nothing of a test scene; choose viewpoints that look at the stack"
            )
        visible = self._draw(surfaces.visible, rng)
        full = self._draw(surfaces.full, rng)
        dense = sample_surface(surfaces.full, self.dense_points, rng)
        second_dense = sample_surface(surfaces.full, self.dense_points, rng)
        floors = {
            "chamfer_visible": chamfer(self._draw(surfaces.visible, rng), visible),
            "chamfer_full": chamfer(self._draw(surfaces.full, rng), full),
            "chamfer_full_dense": chamfer(second_dense.points, dense.points),
        }
        share = visible_share(surfaces.full, surfaces.visible)
        return TruePoints(visible, full, dense, share, floors)

    def compare(
        self, predicted: Surfaces | None, truth: TruePoints, rng: np.random.Generator
    ) -> dict[str, float]:
        """Scores of one predicted scene by name."""
        visible = self.visible(predicted, truth.visible, rng)
        return {"chamfer_visible": visible} | self._full(predicted, truth, rng)

    def visible(
        self, predicted: Surfaces | None, points: Float64, rng: np.random.Generator
    ) -> float:
        """Chamfer distance (m) of the visible surface from points (P, 3) on the true one."""
        if predicted is None or predicted.visible is None:
            return self.absent
        return chamfer(self._draw(predicted.visible, rng), points)

    def _full(
        self, predicted: Surfaces | None, truth: TruePoints, rng: np.random.Generator
    ) -> dict[str, float]:
        if predicted is None:
            return {
                "chamfer_full": self.absent,
                "chamfer_full_dense": self.absent,
                self.f_score_name: 0.0,
                "normal_consistency": 0.0,
                "absent": 1.0,
            }
        dense = sample_surface(predicted.full, self.dense_points, rng)
        neighbours = nearest(dense.points, truth.dense.points)
        return {
            "chamfer_full": chamfer(self._draw(predicted.full, rng), truth.full),
            "chamfer_full_dense": chamfer_of(neighbours),
            self.f_score_name: f_score(neighbours, self.threshold),
            "normal_consistency": normal_consistency(dense, truth.dense, neighbours),
            "absent": 0.0,
        }

    def _draw(self, mesh: TriangleMesh, rng: np.random.Generator) -> np.ndarray:
        return sample_surface(mesh, self.points, rng).points
