"""The plane of the table in depth images themselves, whatever their poses are said to be."""

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

from scenefw.core.batches import CameraBatch

_ACROSS = 40  # blocks whose mean is one point: a plane needs few, and noise averages out
_SCALES = (0.08, 0.05, 0.03, 0.02, 0.01, 0.006, 0.004, 0.003)  # m, one per refinement
_SYMMETRIC = 2  # refinements at the end
_BELOW = 0.03  # m, nothing lies so far below a table
_ABOVE = 0.3  # weight of points above the plane, where objects are; those below count 1
_LEAST = 0.02  # share of measured pixels without which there is no plane


def heights_above_planes(depth: Tensor, cameras: CameraBatch) -> Tensor:
    """Heights (B, H, W) of all pixels above the plane of their own image (m).

    Where an image has no plane (hardly a measurement) its heights are NaN.

    Args:
        depth: (B, H, W) z-depth, 0 or NaN = nothing.
        cameras: of the images; their poses are not read.
    """
    planes = table_planes(depth, cameras)
    x, y = _rays(cameras, depth)
    a, b, c = planes[:, :, None, None].unbind(1)
    inverse = a * x + b * y + c
    return (1 - depth * inverse) / planes.norm(dim=1)[:, None, None]


def table_planes(depth: Tensor, cameras: CameraBatch) -> Tensor:
    """Planes (B, 3) as p with p . x = 1 for points x of the table in the camera's frame.

    Inverse depth is linear in the pixel on a plane, and the table is the farthest one: a least
    squares fit, reweighted by Tukey's biweight with a scale that shrinks to a few millimetres or
    the image's own noise. Points that lie below the plane, which nothing but noise does, count
    more than those above (asymmetric least squares, Newey and Powell 1987).
    """
    x, y, z, share = _blocks(depth, cameras)
    points = torch.stack(torch.broadcast_tensors(x, y, torch.ones_like(z)), -1).flatten(1, 2)
    noise = 3 * _noise(z, share > 0)[:, None]
    z, weight = z.flatten(1), share.flatten(1)
    plane = _solved(points, 1 / z, weight)
    for scale in _SCALES:
        upper_scale, lower_scale = noise.clamp(min=scale), noise.clamp(min=max(scale, _BELOW))
        height = (1 - z * _applied(points, plane)) / plane.norm(dim=1, keepdim=True)
        share = torch.where(
            height > 0, _ABOVE * _biweight(height / upper_scale), _biweight(height / lower_scale)
        )
        plane = _solved(points, 1 / z, weight * share)
    for _ in range(_SYMMETRIC):
        height = (1 - z * _applied(points, plane)) / plane.norm(dim=1, keepdim=True)
        plane = _solved(points, 1 / z, weight * _biweight(height / noise.clamp(min=_SCALES[-1])))
    enough = weight.mean(dim=1, keepdim=True) >= _LEAST
    return torch.where(enough, plane, torch.nan).float()


def _blocks(depth: Tensor, cameras: CameraBatch) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Rays x and y, mean depths z and shares of measured pixels of blocks, as float64."""
    valid = ((depth > 0) & depth.isfinite()).double()
    size = 2 * [max(1, cameras.width // _ACROSS)]
    share = avg_pool2d(valid, size)
    total = avg_pool2d(torch.where(valid > 0, depth, 0.0).double(), size)
    x, y = (part.double() for part in _rays(cameras, depth))
    x, y = avg_pool2d(x, [1, size[0]]), avg_pool2d(y, [size[0], 1])
    return x, y, torch.where(share > 0, total / share.clamp(min=1e-9), 1.0), share


def _rays(cameras: CameraBatch, depth: Tensor) -> tuple[Tensor, Tensor]:
    """Points (B, 1, W) and (B, H, 1) that pixels look through at depth 1."""
    fx, fy, cx, cy = cameras.intrinsics[:, :, None].unbind(1)
    x = (torch.arange(cameras.width, device=depth.device) - cx) / fx
    y = (torch.arange(cameras.height, device=depth.device) - cy) / fy
    return x[:, None], y[:, :, None]


def _applied(points: Tensor, plane: Tensor) -> Tensor:
    return (points * plane[:, None]).sum(dim=-1)  # not @, which TF32 would round


def _biweight(residual: Tensor) -> Tensor:
    return (1 - residual.clamp(-1, 1) ** 2) ** 2


def _solved(points: Tensor, inverse: Tensor, weight: Tensor) -> Tensor:
    """Planes (B, 3) by weighted least squares; ridge keeps the matrix regular."""
    weighted = points * weight[..., None]
    matrix = (weighted[..., None] * points[:, :, None]).sum(dim=1)
    right = (weighted * inverse[..., None]).sum(dim=1)
    ridge = 1e-9 * (1 + matrix.diagonal(dim1=1, dim2=2).sum(dim=1))
    matrix = matrix + ridge[:, None, None] * torch.eye(3, device=matrix.device, dtype=matrix.dtype)
    planes: Tensor = torch.linalg.solve(matrix, right)
    return planes


def _noise(depth: Tensor, valid: Tensor) -> Tensor:
    """Standard deviations (B,) of depth (m) by second differences along rows (1.4826 MAD)."""
    second = (depth[:, :, :-2] - 2 * depth[:, :, 1:-1] + depth[:, :, 2:]).abs()
    valid_triples = valid[:, :, :-2] & valid[:, :, 1:-1] & valid[:, :, 2:]
    median = torch.where(valid_triples, second, torch.nan).flatten(1).nanmedian(dim=1).values
    return 1.4826 / 6**0.5 * median.nan_to_num(0.0)
