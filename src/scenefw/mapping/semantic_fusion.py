"""Class probabilities of a height map's vertices from labelled views, in map space (thesis 4.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from scenefw.core.height_maps import HeightGrid, HeightMap
from scenefw.core.labelling_protocols import State
from scenefw.core.settings import NOT_NEGATIVE
from scenefw.core.types import Frame
from scenefw.kernels import label_fusion
from scenefw.kernels.compile import float32
from scenefw.mapping.label_state import require_labels, require_settings, start_logits
from scenefw.mapping.pyramid import Pyramid


@dataclass(eq=False)
class SemanticFusion:
    """Bayesian fusion of per-pixel distributions into the triangles they fall in (eqs 4.4-4.10).

    Each pixel adds the logarithm of its expected likelihood (eq. 4.10) to the three vertices of its
    triangle, times their barycentric coefficients as exponents: these add up to one, so a pixel is
    counted once (the thesis says "divided by" the coefficient, against its own figure 4.4). A pixel
    belongs to the level of detail that fits its footprint, as in height fusion, else a far camera
    would leave vertices between pixels unlabelled; a coarser level's sums are divided among the
    finer vertices it stands for. Eq. 4.8 gives likelihood 0 to other classes at distance 0: here
    the distribution is mixed with the uniform one so that none falls below `floor`.

    Results don't depend on the number of threads; on CUDA sums vary in their last bits.

    Args:
        alpha: decay of a pixel's weight with its horizontal distance from the vertex, per spacing
            of the vertices of its level (eq. 4.8).
        floor: smallest likelihood of a class, in (0, 1 / C).
        angle_power: pixels weigh cos^power of the angle between their ray and the vertical.
        a: pixels that a triangle of the chosen level covers.
        device: where the probabilities live.
    """

    reads_map = False

    alpha: float = 1.0
    floor: float = 1e-3
    angle_power: float = 0.0
    a: float = 0.5
    device: str = "cpu"

    def __post_init__(self) -> None:
        NOT_NEGATIVE.require(alpha=self.alpha)
        require_settings(self.floor, self.angle_power)

    def begin(
        self,
        grid: HeightGrid,
        classes: int,
        previous: NDArray[np.float32] | None = None,
        state: State | None = None,
    ) -> RunningSemanticFusion:
        """Starts from uniform probabilities or resumes.

        Args:
            grid: vertices and levels of detail.
            classes: C.
            previous: (C, V, V) of an earlier map; certainty beyond float16 is lost.
            state: of `RunningSemanticFusion.state`; resumes as if never interrupted.

        Raises:
            InputError: the earlier probabilities or state have another grid or other classes.
        """
        return RunningSemanticFusion(self, grid, classes, previous, state)


class RunningSemanticFusion:
    """Class probabilities, refined frame by frame; made by `SemanticFusion.begin`."""

    def __init__(
        self,
        fusion: SemanticFusion,
        grid: HeightGrid,
        classes: int,
        previous: NDArray[np.float32] | None,
        state: State | None,
    ) -> None:
        require_settings(fusion.floor, fusion.angle_power, classes)
        self._fusion, self._classes = fusion, classes
        self._pyramid = Pyramid(grid, fusion.a, fusion.device)
        self._logits = torch.zeros((self._pyramid.vertices, classes), device=fusion.device)
        start_logits(self._logits, self._pyramid.finest, grid, previous, state)

    def add(
        self,
        probabilities: NDArray[np.float32],
        frame: Frame,
        heights: HeightMap | None = None,
    ) -> None:
        """Fuses the labels of a frame; pixels without depth are skipped.

        Args:
            probabilities: (C, H, W) that sum to 1 over the classes.
            frame: depth and camera, whose pose is in the world frame.
            heights: not read.

        Raises:
            InputError: probabilities of another shape, or not finite.
        """
        labels = require_labels(probabilities, frame, self._classes).to(self._logits.device)
        landed = self._pyramid.locate(frame)
        size = (landed.pixels, self._classes)
        settings = float32(self._fusion.alpha, self._fusion.floor, self._fusion.angle_power)
        label_fusion.add(
            landed.pixels, *landed.arguments, labels.view(-1), self._logits.view(-1), size, settings
        )

    def probabilities(self) -> NDArray[np.float32]:
        """(C, V, V), uniform where no frame has labelled the vertex."""
        classes, grid = self._classes, self._pyramid.grid
        logits, merged = self._logits.view(-1), self._logits.new_empty(0)
        for level in self._pyramid.levels():
            coarse, count = merged, level[1] ** 2
            merged = self._logits.new_empty(count * classes)
            label_fusion.merge(count, logits, coarse, merged, level, classes)
        vertices = grid.vertices**2
        probabilities = self._logits.new_empty((classes, *grid.shape))
        label_fusion.normalise(vertices, merged, probabilities.view(-1), vertices, classes)
        return probabilities.cpu().numpy()

    def state(self) -> State:
        """The whole state: `logits` (vertices of all levels, C)."""
        return {"logits": self._logits.cpu().numpy().copy()}
