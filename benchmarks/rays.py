"""Depth images and partial TSDFs beside open3d and torch, on a stack of a ball and two boxes."""

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from benchmarks.harness import Job
from scenefw.core.batches import CameraBatch
from scenefw.core.geometry import inverse, look_at
from scenefw.core.types import Camera, GridSpec
from scenefw.kernels.cameras import stack_cameras
from scenefw.mapping.inverse_ray_tracing import InverseRayTracing
from scenefw.mapping.projective import Projective
from scenefw.renderers.sphere_tracer import SphereTracer

GRID = GridSpec()
VIEW = Camera(T_world_camera=look_at((0.8, 0.3, 0.5), (0.0, 0.0, 0.1)))
CAMERAS = stack_cameras([VIEW])


def stack_tsdf() -> Tensor:
    """(1, 1, 64, 64, 64) metres."""
    points = GRID.centres()
    ball = np.linalg.norm(points - [0.12, 0.0, 0.12], axis=-1) - 0.12
    lower = _box(points, (-0.12, 0.05, 0.08), (0.08, 0.12, 0.08))
    upper = _box(points, (-0.1, 0.03, 0.21), (0.1, 0.05, 0.05))
    cut = np.minimum(np.minimum(ball, lower), upper).clip(-GRID.truncation, GRID.truncation)
    return torch.from_numpy(cut).float()[None, None]


def _box(points: np.ndarray, centre: tuple[float, ...], half: tuple[float, ...]) -> np.ndarray:
    q = np.abs(points - centre) - half
    return np.linalg.norm(q.clip(min=0), axis=-1) + q.max(axis=-1).clip(max=0)


def stack_depth() -> Tensor:
    """(1, 480, 640) metres, floor included."""
    return SphereTracer().render(stack_tsdf(), GRID, CAMERAS)


def trace() -> Callable[[], object]:
    """Sphere tracing."""
    tracer, volume = SphereTracer(), stack_tsdf()
    return lambda: tracer.render(volume, GRID, CAMERAS)


def trace_open3d() -> Callable[[], object]:
    """Ray casting of the marching-cubes mesh and a floor."""
    import open3d as o3d
    from skimage.measure import marching_cubes

    vertices, faces, _, _ = marching_cubes(stack_tsdf()[0, 0].numpy(), 0.0)
    floor = np.array([[-50, -50, 0], [50, -50, 0], [50, 50, 0], [-50, 50, 0]])
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(GRID.to_world(vertices).astype(np.float32), faces.astype(np.uint32))
    scene.add_triangles(floor.astype(np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.uint32))
    v, u = np.mgrid[: VIEW.height, : VIEW.width]
    local = np.stack([(u - VIEW.cx) / VIEW.fx, (v - VIEW.cy) / VIEW.fy, np.ones(u.shape)], -1)
    ahead = local @ VIEW.T_world_camera[:3, :3].T
    origin = np.broadcast_to(VIEW.T_world_camera[:3, 3], ahead.shape)
    rays = o3d.core.Tensor(np.concatenate([origin, ahead], -1).astype(np.float32))
    return lambda: scene.cast_rays(rays)["t_hit"].numpy()


def project() -> Callable[[], object]:
    """Projective fusion."""
    mapping, depth = Projective(), stack_depth()
    return lambda: mapping.fuse(depth, GRID, CAMERAS)


def integrate_open3d() -> Callable[[], object]:
    """A dense volume of the same size; weights and colour slots come with it."""
    import open3d as o3d

    volume = o3d.pipelines.integration.UniformTSDFVolume(
        GRID.extent,
        GRID.resolution,
        GRID.truncation,
        o3d.pipelines.integration.TSDFVolumeColorType.NoColor,
        origin=np.array(GRID.lower)[:, None],
    )
    depth = stack_depth()[0].numpy()
    image = o3d.geometry.RGBDImage.create_from_color_and_depth(
        o3d.geometry.Image(np.zeros((*depth.shape, 3), np.uint8)),
        o3d.geometry.Image(depth),
        depth_scale=1.0,
        depth_trunc=10.0,
        convert_rgb_to_intensity=False,
    )
    intrinsic = o3d.camera.PinholeCameraIntrinsic(
        VIEW.width, VIEW.height, VIEW.fx, VIEW.fy, VIEW.cx, VIEW.cy
    )
    extrinsic = inverse(VIEW.T_world_camera)
    return lambda: volume.integrate(image, intrinsic, extrinsic)


def integrate_open3d_blocks() -> Callable[[], object]:
    """A sparse grid of 8^3 blocks, block search included, as in open3d's own examples."""
    import open3d as o3d

    blocks = o3d.t.geometry.VoxelBlockGrid(
        ("tsdf", "weight"),
        (o3d.core.float32, o3d.core.float32),
        ((1,), (1,)),
        voxel_size=GRID.voxel_size,
        block_resolution=8,
        block_count=20_000,
    )
    image = o3d.t.geometry.Image(stack_depth()[0].numpy()[..., None])
    intrinsic = o3d.core.Tensor(VIEW.matrix)
    extrinsic = o3d.core.Tensor(inverse(VIEW.T_world_camera))

    def integrate() -> None:
        found = blocks.compute_unique_block_coordinates(
            image, intrinsic, extrinsic, 1.0, 3.0, GRID.truncation_voxels
        )
        blocks.integrate(found, image, intrinsic, extrinsic, 1.0, 3.0, GRID.truncation_voxels)

    return integrate


def spread() -> Callable[[], object]:
    """Inverse ray tracing."""
    mapping, depth = InverseRayTracing(), stack_depth()
    return lambda: mapping.fuse(depth, GRID, CAMERAS)


def spread_torch() -> Callable[[], object]:
    """The same definition in whole-array torch operations."""
    depth = stack_depth()
    return lambda: scatter_inverse_rays(depth, GRID, CAMERAS)


def scatter_inverse_rays(
    depth: Tensor, grid: GridSpec, cameras: CameraBatch, step: float = 0.025, behind: float = 0.01
) -> Tensor:
    """Distances (X, Y, Z) of one view by inverse ray tracing, with torch's scatter operations."""
    position, ray, distance = _samples(depth, grid, cameras, step, behind)
    low = position.floor().long()
    n = grid.resolution
    corners = torch.cartesian_prod(*[torch.arange(2)] * 3)
    voxels = low[:, None] + corners
    offset = voxels - position[:, None]
    weight = (1 - offset.abs()).prod(-1)
    value = distance[:, None] - (offset * ray[:, None]).sum(-1)
    inside = ((voxels >= 0) & (voxels < n)).all(-1)
    index = ((voxels[..., 0] * n + voxels[..., 1]) * n + voxels[..., 2])[inside]
    far = distance.abs()[:, None].expand(-1, 8)[inside]
    closest = torch.full((n**3,), torch.inf).scatter_reduce(0, index, far, "amin")
    kept = far <= closest[index] + 2
    index, weight, value = index[kept], weight[inside][kept], value[inside][kept]
    total = torch.zeros(n**3).scatter_add(0, index, weight)
    summed = torch.zeros(n**3).scatter_add(0, index, weight * value)
    mean = (summed / total * grid.voxel_size).clamp(-grid.truncation, grid.truncation)
    return torch.where(total > 0, mean, grid.truncation).view(grid.shape)


def _samples(
    depth: Tensor, grid: GridSpec, cameras: CameraBatch, step: float, behind: float
) -> tuple[Tensor, Tensor, Tensor]:
    """Positions (S, 3) in voxels, unit rays (S, 3) and signed distances (S,) in voxels."""
    fx, fy, cx, cy = cameras.intrinsics[0]
    pose = cameras.T_world_camera[0]
    v, u = torch.meshgrid(torch.arange(cameras.height), torch.arange(cameras.width), indexing="ij")
    local = torch.stack([(u - cx) / fx, (v - cy) / fy, torch.ones_like(u)], -1)
    ahead = local @ pose[:3, :3].T
    surface = pose[:3, 3] + depth[0, ..., None] * ahead
    surface = (surface - torch.tensor(grid.lower)) / grid.voxel_size - 0.5
    phase = (u * 0.7548777 + v * 0.5698403).frac() * step - behind
    count = int(np.ceil((grid.truncation + behind) / step))
    metres = phase[..., None] + step * torch.arange(count)
    used = (metres < grid.truncation) & (depth[0, ..., None] > 0)
    ray = torch.nn.functional.normalize(ahead, dim=-1)[..., None, :].expand(-1, -1, count, -1)
    distance = metres / grid.voxel_size
    position = surface[..., None, :] - distance[..., None] * ray
    used &= ((position > -1) & (position < grid.resolution)).all(-1)
    return position[used], ray[used], distance[used]


JOBS = [
    Job(
        "depth 640 x 480 of a 64^3 TSDF",
        trace,
        {"open3d ray casting of its marching-cubes mesh": trace_open3d},
    ),
    Job(
        "projective partial TSDF 64^3 of 640 x 480",
        project,
        {
            "open3d UniformTSDFVolume": integrate_open3d,
            "open3d VoxelBlockGrid": integrate_open3d_blocks,
        },
    ),
    Job(
        "inverse ray tracing 64^3 of 640 x 480",
        spread,
        {"torch scatter operations": spread_torch},
    ),
]
