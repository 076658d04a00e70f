"""Class probabilities of a height map's vertices from labelled views, in image space (fig. 4.5)."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.height_maps import HeightGrid, HeightMap
from scenefw.core.labelling_protocols import State
from scenefw.core.types import Camera, Frame
from scenefw.kernels import label_fusion
from scenefw.kernels.cameras import finite, stack_cameras
from scenefw.kernels.compile import float32
from scenefw.kernels.triangles import UNSEEN
from scenefw.mapping.label_state import (
    require_labels,
    require_settings,
    start_logits,
)


class ImageSpaceFusion:
    """Bayesian fusion of the distribution between the four pixels around each vertex's projection.

    A vertex is seen where its nearest pixel's depth agrees with its own. The interpolated
    distribution is mixed with the uniform one so that no class falls below `floor`, and its
    logarithm is added (eq. 4.5). A far pixel labels several vertices, a near one maybe none.
    Results don't depend on the number of threads.

    Args:
        floor: smallest likelihood of a class, in (0, 1 / C).
        tolerance: a vertex that lies farther than this (m) along the optical axis from what its
            pixel measured is hidden.
        angle_power: vertices weigh cos^power of the angle between their ray and the vertical.
        device: where the probabilities live.
    """

    reads_map = True

    def __init__(
        self,
        floor: float = 1e-3,
        tolerance: float = 0.01,
        angle_power: float = 0.0,
        device: str = "cpu",
    ) -> None:
        if not tolerance > 0:
            raise ConfigError(f"tolerance = {tolerance}, expected metres > 0")
        require_settings(floor, angle_power)
        self.floor, self.tolerance, self.angle_power = floor, tolerance, angle_power
        self.device = device

    def begin(
        self,
        grid: HeightGrid,
        classes: int,
        previous: NDArray[np.float32] | None = None,
        state: State | None = None,
    ) -> RunningImageSpaceFusion:
        """Starts from uniform probabilities or resumes.

        Args:
            grid: the vertices.
            classes: C.
            previous: (C, V, V) of an earlier map; certainty beyond float16 is lost.
            state: of `RunningImageSpaceFusion.state`; resumes as if never interrupted.

        Raises:
            InputError: the earlier probabilities or state have another grid or other classes.
        """
        return RunningImageSpaceFusion(self, grid, classes, previous, state)


class RunningImageSpaceFusion:
    """Class probabilities, refined frame by frame; made by `ImageSpaceFusion.begin`."""

    def __init__(
        self,
        fusion: ImageSpaceFusion,
        grid: HeightGrid,
        classes: int,
        previous: NDArray[np.float32] | None,
        state: State | None,
    ) -> None:
        require_settings(fusion.floor, fusion.angle_power, classes)
        self._fusion, self._grid, self._classes = fusion, grid, classes
        self._logits = torch.zeros((grid.vertices**2, classes), device=fusion.device)
        start_logits(self._logits, slice(None), grid, previous, state)

    def add(
        self,
        probabilities: NDArray[np.float32],
        frame: Frame,
        heights: HeightMap | None = None,
    ) -> None:
        """Fuses the labels of the pixels around each vertex in view.

        Args:
            probabilities: (C, H, W) that sum to 1 over the classes.
            frame: depth and camera, whose pose is in the world frame.
            heights: the map so far; where it is unseen nothing is fused.

        Raises:
            InputError: no height map or one of another grid; probabilities of another shape.
        """
        if heights is None or heights.grid != self._grid:
            raise InputError(
                f"fusing labels in image space needs a height map of {self._grid}, got "
                f"{heights and heights.grid}; give the map of the frames so far"
            )
        part = self._part(frame.camera, heights)
        if part is None:
            return
        device = self._logits.device
        labels = require_labels(probabilities, frame, self._classes).to(device)
        height_values = torch.from_numpy(np.ascontiguousarray(heights.heights)).to(device)
        height_values = finite(height_values, float(UNSEEN))
        depth = finite(torch.from_numpy(np.ascontiguousarray(frame.depth)).to(device), 0.0)
        cameras = stack_cameras([frame.camera], device)
        top, bottom, left, right = part
        lower_x, lower_y = self._grid.lower
        label_fusion.look(
            (bottom - top) * (right - left),
            height_values.view(-1),
            depth.view(-1), labels.view(-1), cameras.intrinsics, cameras.T_world_camera,
            self._logits.view(-1),
            (self._grid.vertices, frame.camera.width, frame.camera.height, self._classes),
            (top, left, right - left),
            float32(lower_x, lower_y + self._grid.extent, self._grid.spacing),
            float32(self._fusion.floor, self._fusion.tolerance, self._fusion.angle_power),
        )  # fmt: skip

    def probabilities(self) -> NDArray[np.float32]:
        """(C, V, V), uniform where no frame has labelled the vertex."""
        vertices = self._grid.vertices**2
        probabilities = self._logits.new_empty((self._classes, *self._grid.shape))
        label_fusion.normalise(
            vertices, self._logits.view(-1), probabilities.view(-1), vertices, self._classes
        )
        return probabilities.cpu().numpy()

    def state(self) -> State:
        """The whole state: `logits` (V * V, C)."""
        return {"logits": self._logits.cpu().numpy().copy()}

    def _part(self, camera: Camera, heights: HeightMap) -> tuple[int, int, int, int] | None:
        """Rows and columns that the view may meet between the lowest and the highest vertex."""
        n, low, high = self._grid.vertices, *_range(heights)
        eye, rays = camera.T_world_camera[:3, 3], _corner_rays(camera)
        if not low <= high:
            return None
        if (rays[:, 2] > -1e-3).any() or eye[2] <= high:  # the horizon is in view
            return 0, n, 0, n
        reach = (np.array([[low], [high]]) - eye[2]) / rays[:, 2]
        points = eye[:2] + reach[..., None] * rays[:, :2]
        spots = self._grid.to_vertices(points).reshape(-1, 2)
        first = np.clip(np.floor(spots.min(axis=0)), 0, n).astype(int)
        last = np.clip(np.ceil(spots.max(axis=0)) + 1, 0, n).astype(int)
        if (last <= first).any():
            return None
        return int(first[0]), int(last[0]), int(first[1]), int(last[1])


def _range(heights: HeightMap) -> tuple[float, float]:
    """Lowest and highest seen vertex; infinite and empty where none is."""
    values = heights.heights
    low = np.fmin.reduce(values, axis=None, initial=np.inf)
    return float(low), float(np.fmax.reduce(values, axis=None, initial=-np.inf))


def _corner_rays(camera: Camera) -> NDArray[np.float64]:
    """World directions (4, 3) through the outer corners of the image, 1 along the optical axis."""
    u = np.array([-0.5, camera.width - 0.5, -0.5, camera.width - 0.5])
    v = np.array([-0.5, -0.5, camera.height - 0.5, camera.height - 0.5])
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(4)], axis=1)
    turned: NDArray[np.float64] = rays @ camera.T_world_camera[:3, :3].T
    return turned
