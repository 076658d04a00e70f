"""Class-agnostic instances by 3D Hough voting for object centres (thesis 5.2.1, eq. 5.6)."""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import avg_pool3d, max_pool3d

from scenefw.core.errors import InputError
from scenefw.core.settings import COUNT, NOT_NEGATIVE, POSITIVE
from scenefw.core.types import GridSpec
from scenefw.kernels.precision import distances
from scenefw.kernels.votes import count_traversals, shift_to_modes

_SHORTEST_VOTE = 1e-3
_MOST_BRICKS = 4096  # busiest voxels that are given cells
_MOST_CENTRES = 32
_MOST_JUDGES = 32768  # voxels that decide which centres stay
_STEPS = 64
_COARSENING = 3
_REFERENCE_VOXEL = 1 / 64  # m: the thesis's voxel, for which its gamma was found


class Rays(NamedTuple):
    """Inside voxels of one scene, cropped to where objects are.

    Args:
        voxels: (M, 3) int32 indices into the crop.
        votes: (M, 3) float32 unit vectors, 0 where there is no vote.
        blocks: (x, y, z) int32 numbers of the voxels that rays may cross, -2 elsewhere.
        corner: (3,) first voxel of the crop.
    """

    voxels: Tensor
    votes: Tensor
    blocks: Tensor
    corner: Tensor


@dataclass(eq=False)
class HoughVoting:
    """Finds object centres where many centre votes meet and gives each voxel to one of them.

    Every voxel inside an object sends a ray along its vote through a grid `subdivisions` times
    finer, as far as the inside of objects reaches. Cells crossed more than `threshold` times go to
    a mean shift, weighted by their counts; its modes are the centres. A voxel with unit vote v
    belongs to the centre c_n (seen from the voxel) of least |arccos(v . c_n/|c_n|)| + gamma |c_n|
    (eq. 5.6).

    The thesis stops there, which suits exact votes. Noisy votes miss each other in cells this
    fine, and whole objects would be lost. So the vote is repeated in cells of thrice the size, down
    to whole voxels, for centres that the finer cells do not show; costs are mixed with those of
    neighbouring voxels; and a centre must earn its place: those are removed, worst first, whose
    voxels could go to the second best centre for less than `gain` more on average, or that hold
    less than `smallest`.

    Args:
        threshold: mu: a cell needs more rays than this.
        subdivisions: cells per side of a voxel.
        gamma: weight of the distance to a centre, in rad per 1/64 m (the thesis's voxel).
        bandwidth: of the mean shift's Gaussian (m).
        merging: centres nearer than this to a stronger one join it (m).
        gain: what a centre must spare its voxels on average (rad).
        smallest: least volume of an instance (m^3).
        smoothing: share of the neighbours' mean in a voxel's cost, 0 for none.
    """

    threshold: int = 10
    subdivisions: int = 10
    gamma: float = 0.1
    bandwidth: float = 0.012
    merging: float = 0.025
    gain: float = 0.5
    smallest: float = 3e-5
    smoothing: float = 0.7

    def __post_init__(self) -> None:
        COUNT.require(subdivisions=self.subdivisions)
        POSITIVE.require(bandwidth=self.bandwidth)
        NOT_NEGATIVE.require(threshold=self.threshold)

    @torch.no_grad()
    def extract(self, tsdf: Tensor, votes: Tensor, grid: GridSpec) -> tuple[Tensor, Tensor]:
        """Instances (X, Y, Z) int32, 1..N by size, and their centres (N, 3) metres.

        Args:
            tsdf: (X, Y, Z) metres, negative inside.
            votes: (3, X, Y, Z), any length; voxels with (near) zero votes send no ray.
            grid: the voxel grid of both.

        Raises:
            InputError: shapes do not fit the grid or values are not finite.
        """
        _require(tsdf, votes, grid)
        instances = torch.zeros(tsdf.shape, dtype=torch.int32, device=tsdf.device)
        rays = _rays(tsdf, votes, grid)
        if rays is None:
            return instances, torch.zeros(0, 3, device=tsdf.device)
        centres = self._centres(rays, grid.voxel_size)
        costs = self._costs(rays, centres, grid.voxel_size)
        alive = self._deserving(costs, grid.voxel_size)
        labels, order = _by_size(costs[:, alive].argmin(dim=1), len(alive))
        where = rays.voxels.long() + rays.corner
        instances[where[:, 0], where[:, 1], where[:, 2]] = (labels + 1).to(torch.int32)
        lower = torch.tensor(grid.lower, device=tsdf.device, dtype=torch.float32)
        positions = centres[alive][order] + rays.corner + 0.5
        return instances, positions * grid.voxel_size + lower

    def _centres(self, rays: Rays, voxel: float) -> Tensor:
        """Centres (N, 3) in voxels of the crop, from finest cells to coarsest."""
        centres = rays.voxels.new_zeros(0, 3, dtype=torch.float32)
        traversals = _count(rays, rays.blocks, 1)
        subdivisions = self.subdivisions
        while subdivisions >= 1:
            cells, counts = self._busy_cells(rays, traversals, subdivisions)
            modes = _modes(cells, counts, rays.blocks.shape, self.bandwidth / voxel)
            centres = _merge_modes(centres, modes, self.merging / voxel)
            subdivisions //= _COARSENING
        if not len(centres):  # nothing but a handful of voxels: one object
            return rays.voxels.float().mean(dim=0, keepdim=True)
        return centres[:_MOST_CENTRES]

    def _busy_cells(
        self, rays: Rays, traversals: Tensor, subdivisions: int
    ) -> tuple[Tensor, Tensor]:
        """Positions (C, 3) in voxels and counts (C,) of cells with more than `threshold` rays."""
        # No cell is crossed more often than its voxel: cells are laid out in busy voxels alone.
        quiet = self.threshold
        if len(traversals) > _MOST_BRICKS:
            quiet = max(quiet, int(torch.topk(traversals, _MOST_BRICKS).values[-1]))
        busy = traversals > quiet
        number = torch.cumsum(busy, dim=0, dtype=torch.int32) - 1
        number[~busy] = -1
        passable = rays.blocks >= 0
        blocks = rays.blocks.clone()
        blocks[passable] = number
        counts = _count(rays, blocks, subdivisions) if subdivisions > 1 else traversals[busy]
        indices = (counts > self.threshold).nonzero()[:, 0]
        s = subdivisions
        offset = torch.stack([indices // (s * s) % s, indices // s % s, indices % s], dim=1)
        corners = passable.nonzero()[busy][indices // s**3]
        return corners + (offset + 0.5) / s - 0.5, counts[indices]

    def _costs(self, rays: Rays, centres: Tensor, voxel: float) -> Tensor:
        """Eq. 5.6 of every inside voxel and centre (M, N), averaged over neighbours inside."""
        to_centre = centres[None] - rays.voxels[:, None]
        distance = to_centre.norm(dim=2)
        cosine = (to_centre * rays.votes[:, None]).sum(dim=2) / distance.clamp(min=1e-6)
        gamma = self.gamma * voxel / _REFERENCE_VOXEL
        costs = torch.acos(cosine.clamp(-1, 1)) + gamma * distance
        if self.smoothing <= 0:
            return costs
        return torch.lerp(costs, _averaged(costs, rays), self.smoothing)

    def _deserving(self, costs: Tensor, voxel: float) -> Tensor:
        """Indices of the centres without which the votes would be explained clearly worse.

        Each voxel goes to its cheapest centre. A centre is worth what its voxels save by it, on
        average, beside the second cheapest one; one that gets less than `smallest` is worth less
        than nothing. The worst is dropped, and its voxels dealt out anew, until every centre that
        is left is worth `gain`.

        Args:
            costs: (M, N) of inside voxels and centres, as `_costs`.
            voxel: its side (m).
        """
        stride = -(-len(costs) // _MOST_JUDGES)
        costs, volume = costs[::stride], stride * voxel**3
        alive = torch.arange(costs.shape[1], device=costs.device)
        while len(alive) > 1:
            best, candidates = torch.topk(costs[:, alive], 2, dim=1, largest=False)
            sizes = torch.bincount(candidates[:, 0], minlength=len(alive))
            spared = torch.zeros(len(alive), device=costs.device)
            spared.index_add_(0, candidates[:, 0], best[:, 1] - best[:, 0])
            means = spared / sizes.clamp(min=1)
            means[sizes * volume < self.smallest] = -1.0
            worst = int(means.argmin())
            if means[worst] >= self.gain:
                break
            alive = torch.cat([alive[:worst], alive[worst + 1 :]])
        return alive


def _rays(tsdf: Tensor, votes: Tensor, grid: GridSpec) -> Rays | None:
    # The surface passes through voxels up to half a voxel outside: rays may cross these too.
    passable = tsdf < 0.5 * grid.voxel_size
    if not bool((tsdf < 0).any()):
        return None
    box = tuple(_span(passable, axis) for axis in range(3))
    inside = tsdf[box] < 0
    crossed = passable[box]
    blocks = torch.full(crossed.shape, -2, dtype=torch.int32, device=tsdf.device)
    blocks[crossed] = torch.arange(int(crossed.sum()), dtype=torch.int32, device=tsdf.device)
    vectors = votes[:, *box][:, inside].T.float()
    lengths = vectors.norm(dim=1, keepdim=True)
    unit = torch.where(lengths > _SHORTEST_VOTE, vectors / lengths.clamp(min=_SHORTEST_VOTE), 0.0)
    corner = torch.tensor([span.start for span in box], device=tsdf.device)
    return Rays(inside.nonzero().to(torch.int32), unit.contiguous(), blocks, corner)


def _span(mask: Tensor, axis: int) -> slice:
    dims = tuple(dim for dim in range(3) if dim != axis)
    hits = mask.any(dim=dims[1]).any(dim=dims[0]).nonzero()
    # A voxel more on each side: neighbourhoods of 3 voxels fit even around a flat object.
    return slice(max(0, int(hits[0]) - 1), int(hits[-1]) + 2)


def _count(rays: Rays, blocks: Tensor, subdivisions: int) -> Tensor:
    voting = rays.votes.abs().sum(dim=1) > 0
    cells = (int(blocks.max()) + 1) * subdivisions**3
    counts = torch.zeros(cells, dtype=torch.int32, device=blocks.device)
    starts, directions = rays.voxels[voting].contiguous(), rays.votes[voting].contiguous()
    if cells and len(starts):
        count_traversals(len(starts), starts, directions, blocks, subdivisions, counts)
    return counts


def _modes(cells: Tensor, counts: Tensor, shape: torch.Size, bandwidth: float) -> Tensor:
    """Modes (N, 3) of weighted cells, densest first.

    Seeds are the voxels busier than their neighbours.
    """
    if not len(cells):
        return cells.float()
    points, weights = _binned(cells, counts, bandwidth / 2)
    nearest = (points + 0.5).floor().long()
    voxel = (nearest[:, 0] * shape[1] + nearest[:, 1]) * shape[2] + nearest[:, 2]
    volume = torch.zeros(shape.numel(), device=cells.device).index_add_(0, voxel, weights)
    highest = max_pool3d(volume.view(1, 1, *shape), 3, stride=1, padding=1).view(-1)
    seeds = points[(volume == highest)[voxel]].contiguous()
    densities = torch.zeros(len(seeds), device=cells.device)
    shift_to_modes(len(seeds), points, weights, bandwidth, _STEPS, seeds, densities)
    return seeds[torch.argsort(densities, descending=True, stable=True)]


def _binned(cells: Tensor, counts: Tensor, side: float) -> tuple[Tensor, Tensor]:
    """Cells gathered in bins of a side: weighted means (P, 3) and summed counts (P,)."""
    bins = torch.floor(cells / side).long()
    bins -= bins.amin(dim=0)
    extent = bins.amax(dim=0) + 1
    key = (bins[:, 0] * extent[1] + bins[:, 1]) * extent[2] + bins[:, 2]
    _, group = torch.unique(key, return_inverse=True)
    sums = torch.zeros(int(group.max()) + 1, 4, dtype=torch.float64, device=cells.device)
    weighted = torch.cat([cells, torch.ones_like(cells[:, :1])], dim=1) * counts[:, None]
    sums.index_add_(0, group, weighted.double())
    return (sums[:, :3] / sums[:, 3:]).float().contiguous(), sums[:, 3].float()


def _merge_modes(centres: Tensor, modes: Tensor, radius: float) -> Tensor:
    """`centres` and those of `modes` that are farther than `radius` from all before them."""
    points = torch.cat([centres, modes])
    close_pairs = (distances(points, points) < radius).tolist()
    indices = list(range(len(centres)))
    for i in range(len(centres), len(points)):
        if not any(close_pairs[i][k] for k in indices):
            indices.append(i)
    return points[indices]


def _averaged(costs: Tensor, rays: Rays) -> Tensor:
    """Means over the 3 x 3 x 3 voxels around each, of those inside."""
    x, y, z = rays.voxels.long().unbind(dim=1)
    volume = torch.zeros(costs.shape[1] + 1, *rays.blocks.shape, device=costs.device)
    volume[:-1, x, y, z] = costs.T
    volume[-1, x, y, z] = 1.0
    mean = avg_pool3d(volume[:, None], 3, stride=1, padding=1)[:, 0]
    return (mean[:-1, x, y, z] / mean[-1, x, y, z]).T.contiguous()


def _by_size(labels: Tensor, count: int) -> tuple[Tensor, Tensor]:
    """Labels renumbered from largest to smallest, and the old label of each new one."""
    sizes = torch.bincount(labels, minlength=count)
    order = torch.argsort(sizes, descending=True, stable=True)
    rank = torch.empty_like(order)
    rank[order] = torch.arange(count, device=order.device)
    return rank[labels], order


def _require(tsdf: Tensor, votes: Tensor, grid: GridSpec) -> None:
    if tuple(tsdf.shape) != grid.shape or tuple(votes.shape) != (3, *grid.shape):
        raise InputError(
            f"tsdf {tuple(tsdf.shape)} and votes {tuple(votes.shape)} do not fit the grid: "
            f"expected {grid.shape} and {(3, *grid.shape)}; give one scene without its batch "
            "dimension"
        )
    if not bool(torch.isfinite(tsdf.sum() + votes.sum())):  # one NaN or infinity spoils a sum
        raise InputError("tsdf or votes contain NaN or infinity; expected finite numbers")
