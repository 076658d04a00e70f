"""Height maps by incremental least squares over depth pixels (thesis 4.3)."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from scenefw.core.errors import InputError
from scenefw.core.height_maps import HeightGrid, HeightMap
from scenefw.core.labelling_protocols import State
from scenefw.core.settings import COUNT, NOT_NEGATIVE, POSITIVE
from scenefw.core.types import Frame
from scenefw.kernels import heights as kernels
from scenefw.kernels import rivals
from scenefw.kernels.compile import float32
from scenefw.kernels.triangles import UNSEEN
from scenefw.mapping.pyramid import Landed, Pyramid


class HeightFusion:
    """Fuses depth images into a height per vertex of a triangular mesh (Zienkiewicz et al. 2016).

    Each depth pixel falls into a triangle of the level of detail that fits its distance and
    constrains the triangle's three vertices by its barycentric weights (eq. 4.1). The normal
    equations (eq. 4.2) of each level are kept whole, so nothing of earlier frames is lost; a few
    Gauss-Seidel sweeps over what a frame touched follow it. Levels are merged from coarse to fine:
    a coarser one counts as at most `prior` of a measurement at vertices that have their own, and
    alone between them. Vertices that no measurement touched at any level stay unseen.
    Results don't depend on the number of threads; on CUDA sums vary in their last bits.

    What eq. 4.2 leaves open: while a vertex has few measurements the equations amplify noise, so
    one whose diagonal of J'J is below `damping` is drawn to the mean of the measurements about it
    by what it lacks; a measurement farther than `outlier` from the surface known so far is weighted
    down as Huber's loss does, and where more measurements of several frames agree on another height
    it becomes the surface, and what was fused before is weighted down (`kernels.rivals`). So a bad
    frame, the first one too, counts little once others outweigh it.

    Args:
        grid: vertices and levels of detail; None = 1025 x 1025 over 1.024 m.
        a: pixels that a triangle of the chosen level covers.
        iterations: of the solver per frame, two Gauss-Seidel sweeps each.
        outlier: distance from the known surface (m) beyond which weights fall; None = never.
        prior: how much coarser levels count at most where a vertex has measurements of its own.
        damping: diagonal of J'J below which a vertex is pulled to the mean around it.
        device: where the map lives.
    """

    def __init__(
        self,
        grid: HeightGrid | None = None,
        a: float = 0.5,
        iterations: int = 2,
        outlier: float | None = 0.01,
        prior: float = 0.1,
        damping: float = 1.0,
        device: str = "cpu",
    ) -> None:
        COUNT.require(iterations=iterations)
        POSITIVE.require(outlier=outlier)
        NOT_NEGATIVE.require(prior=prior, damping=damping)
        self.grid = grid or HeightGrid()
        self.a, self.iterations, self.outlier = a, iterations, outlier
        self.prior, self.damping, self.device = prior, damping, device

    def begin(
        self, previous: HeightMap | None = None, state: State | None = None
    ) -> RunningHeightFusion:
        """Starts an empty map or resumes one.

        Args:
            previous: an earlier map; each seen vertex becomes one measurement of its own, weighted
                by its confidence, so what its neighbours shared is lost.
            state: of `RunningHeightFusion.state`; resumes as if never interrupted.

        Raises:
            InputError: the earlier map or state has another grid.
        """
        running = RunningHeightFusion(self)
        if state is not None:
            running.restore(state)
        elif previous is not None:
            running.adopt(previous)
        return running


class RunningHeightFusion:
    """A height map that grows frame by frame; made by `HeightFusion.begin`."""

    def __init__(self, fusion: HeightFusion) -> None:
        self._fusion = fusion
        self._pyramid = Pyramid(fusion.grid, fusion.a, fusion.device)
        device, vertices = self._pyramid.device, self._pyramid.vertices
        self._sums = torch.zeros(vertices * kernels.RECORD, device=device)
        # The second half holds the neighbours' rows as bands read them while those change.
        self._heights = torch.full((2, vertices), float(UNSEEN), device=device)
        self._rivals, self._far = (torch.zeros(2 * vertices, device=device) for _ in range(2))

    def add(self, frame: Frame) -> None:
        """Fuses depth and colour of a frame, whose camera's pose is in the world frame.

        Raises:
            InputError: intrinsics or a pose that no camera has, or colour of another size.
        """
        landed = self._pyramid.locate(frame)
        (outlier,) = float32(self._fusion.outlier or float(UNSEEN))
        colour = self._colour(frame)
        surface = (self._sums, self._heights[0], self._far)
        kernels.add(landed.pixels, *landed.arguments, colour, *surface, outlier)
        if self._fusion.outlier is not None:
            self._vote(landed, outlier)
        self._solve(landed)

    def height_map(self) -> HeightMap:
        """The map of all frames so far."""
        grid, merged = self._fusion.grid, torch.empty(0, device=self._pyramid.device)
        (prior,) = float32(self._fusion.prior)
        for level in self._pyramid.levels():
            coarse, count = merged, level[1] ** 2
            merged = torch.empty(count * kernels.MERGED, device=self._pyramid.device)
            kernels.merge(count, self._sums, self._heights[0], coarse, merged, level, prior)
        values = merged.view(*grid.shape, kernels.MERGED).cpu().numpy()
        height, confidence, variance = (values[..., k].copy() for k in range(3))
        unseen = height >= UNSEEN
        height[unseen] = variance[unseen] = np.nan
        colour = np.rint(np.clip(values[..., 3:], 0, 255)).astype(np.uint8)
        return HeightMap(grid, height, colour, confidence, variance)

    def state(self) -> State:
        """The whole state: per vertex of all levels `sums` (11), `heights` and `rivals` (2)."""
        sums, rival = self._sums.view(-1, kernels.RECORD), self._rivals.view(-1, 2)
        tensors = {"sums": sums, "heights": self._heights[0], "rivals": rival}
        return {name: tensor.cpu().numpy().copy() for name, tensor in tensors.items()}

    def restore(self, state: State) -> None:
        """Resumes from a state; states of earlier versions have no `rivals`, so there are none.

        Raises:
            InputError: it is of another grid or holds something else.
        """
        parts = {"sums": self._sums, "heights": self._heights[0]}
        if "rivals" in state:
            parts["rivals"] = self._rivals
        for name, tensor in parts.items():
            stored = np.asarray(state.get(name, ()), dtype=np.float32)
            if stored.size != tensor.numel():
                raise InputError(
                    f"state of a height fusion holds {stored.size} values of {name}, but a grid of "
                    f"{self._fusion.grid.vertices} vertices and {self._fusion.grid.levels} levels "
                    f"has {tensor.numel()}; begin with the grid that it was saved with"
                )
            tensor.copy_(torch.from_numpy(stored.reshape(-1)))

    def adopt(self, previous: HeightMap) -> None:
        """Takes each seen vertex of an earlier map as one measurement.

        Raises:
            InputError: it has another grid.
        """
        if previous.grid != self._fusion.grid:
            raise InputError(
                f"the earlier height map has {previous.grid}, this one {self._fusion.grid}; "
                "begin with the grid that it was saved with"
            )
        height = np.nan_to_num(previous.heights).astype(np.float32)
        weight = np.where(previous.seen, previous.confidence, 0).astype(np.float32)
        squares = np.nan_to_num(previous.variance) + height * height
        records = np.zeros((*previous.grid.shape, kernels.RECORD), np.float32)
        records[..., 0] = records[..., 5] = records[..., 10] = weight
        records[..., 4], records[..., 6] = weight * height, weight * squares
        records[..., 7:10] = weight[..., None] * previous.colour
        height[~previous.seen] = UNSEEN
        finest = self._pyramid.finest
        sums = self._sums.view(-1, kernels.RECORD)[finest]
        sums.copy_(torch.from_numpy(records.reshape(-1, kernels.RECORD)))
        self._heights[0, finest].copy_(torch.from_numpy(height.reshape(-1)))

    def _vote(self, landed: Landed, outlier: np.float32) -> None:
        """Where the frame is far from the surface, an alternative with more support takes over."""
        where = (len(landed.bands), landed.bands, self._pyramid.layout, landed.boxes)
        wins = torch.empty_like(landed.bands)
        surface = (self._sums, self._heights[0], self._far, self._rivals)
        rivals.vote(*where, *surface, wins, outlier)
        rivals.take_over(*where, *surface, wins)
        rivals.clear(*where, self._far, wins)

    def _solve(self, landed: Landed) -> None:
        """Sweeps the bands that a frame touched."""
        (damping,) = float32(self._fusion.damping)
        where = (landed.bands, self._pyramid.layout, landed.boxes)
        kernels.begin(len(landed.bands), *where, self._sums, self._heights[0])
        for _ in range(self._fusion.iterations):
            now, before = (self._pyramid.rows(half, landed.boxes) for half in self._heights)
            for rows, copies in zip(now, before, strict=True):
                copies.copy_(rows)
            kernels.relax(len(landed.bands), *where, self._sums, self._heights.view(-1), damping)

    def _colour(self, frame: Frame) -> Tensor:
        if frame.colour is None:
            return torch.empty(0, dtype=torch.uint8, device=self._pyramid.device)
        if frame.colour.shape != (*frame.depth.shape, 3):
            raise InputError(
                f"colour of {frame.name or 'a frame'} has shape {frame.colour.shape}, its depth "
                f"{frame.depth.shape}; both must be aligned images of the same size"
            )
        colour = torch.from_numpy(np.ascontiguousarray(frame.colour, dtype=np.uint8))
        return colour.view(-1).to(self._pyramid.device)
