"""Fusing 320 x 240 frames of a table-top: heights and labels per frame beside volumes and torch.

Open3D integrates the same frames, with their colour, into truncated signed distances: in hashed
blocks of voxels of the same spacing (1 mm), and in dense ones of four times that. (Its
ScalableTSDFVolume takes these depths for millimetres when it looks for blocks, and stays empty.)
The labels' peer does in eager torch what semantic fusion does at the finest level: triangles,
likelihoods, `index_add_`.
"""

from itertools import cycle

import numpy as np
import torch

from benchmarks.harness import Job, Timed, Unavailable
from scenefw.core.geometry import look_at
from scenefw.core.height_maps import HeightGrid, HeightMap
from scenefw.core.types import Camera, Frame
from scenefw.mapping.height_fusion import HeightFusion
from scenefw.mapping.semantic_fusion import SemanticFusion
from scenefw_labelling_studies.image_space_fusion import ImageSpaceFusion

GRID = HeightGrid()
FRAMES = 12
CLASSES = 4
TRUNCATION = 0.005
DENSE = 256  # voxels per side of Open3D's dense volume, which allocates them all


def views() -> list[Camera]:
    """Cameras as in the thesis: 0.18 to 0.40 m high, up to 40 degrees from straight down."""
    rng, cameras = np.random.default_rng(0), []
    for _ in range(FRAMES):
        eye = np.array([*rng.uniform(-0.3, 0.3, 2), rng.uniform(0.18, 0.40)])
        aside, towards = eye[2] * np.tan(np.radians(rng.uniform(0, 40))), rng.uniform(0, 2 * np.pi)
        target = (eye[0] + aside * np.cos(towards), eye[1] + aside * np.sin(towards), 0)
        cameras.append(Camera(T_world_camera=look_at(eye, target)).resized(320, 240))
    return cameras


def frames() -> list[Frame]:
    """Depth of a wavy table with steps, by marching along the rays; random colours."""
    rng = np.random.default_rng(1)
    colours = rng.integers(0, 255, (FRAMES, 240, 320, 3), dtype=np.uint8)
    return [
        Frame(depth_of(view), view, colour) for view, colour in zip(views(), colours, strict=True)
    ]


def heights_at(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Height of the surface (m)."""
    return 0.01 * (np.sin(40 * x) * np.cos(30 * y) > 0.3) + 0.002 * np.sin(100 * x)


def depth_of(view: Camera) -> np.ndarray:
    """Depth where the rays first go below the surface, (H, W) float32."""
    v, u = np.mgrid[: view.height, : view.width]
    local = np.stack([(u - view.cx) / view.fx, (v - view.cy) / view.fy, np.ones(u.shape)], -1)
    rays, eye = local @ view.T_world_camera[:3, :3].T, view.T_world_camera[:3, 3]
    depth = (0.013 - eye[2]) / rays[..., 2]
    for _ in range(200):
        point = eye + depth[..., None] * rays
        above = point[..., 2] - heights_at(point[..., 0], point[..., 1])
        depth += np.clip(above, 0, 1e-4) / np.abs(rays[..., 2])
    return depth.astype(np.float32)


def distributions() -> np.ndarray:
    """Class probabilities (C, H, W)."""
    rng = np.random.default_rng(2)
    return np.moveaxis(rng.dirichlet(np.ones(CLASSES), (240, 320)), -1, 0).astype(np.float32)


def heights() -> Timed:
    """Height fusion with colour."""
    running, turn = HeightFusion(GRID).begin(), cycle(frames())
    return lambda: running.add(next(turn))


def read_out() -> Timed:
    """The height map of what was fused."""
    running = HeightFusion(GRID).begin()
    for frame in frames():
        running.add(frame)
    return running.height_map


def blocks() -> Timed:
    """Open3D's hashed blocks of voxels of the maps' spacing."""
    import open3d as o3d

    core, turn = o3d.core, []
    volume = o3d.t.geometry.VoxelBlockGrid(
        ("tsdf", "weight", "color"), (core.float32, core.float32, core.float32), ((1), (1), (3)),
        GRID.spacing, 16, 20_000,
    )  # fmt: skip
    for frame in frames():
        assert frame.colour is not None
        intrinsics = core.Tensor(frame.camera.matrix)
        pose = core.Tensor(np.linalg.inv(frame.camera.T_world_camera))
        depth = o3d.t.geometry.Image(core.Tensor(frame.depth[..., None]))
        colour = o3d.t.geometry.Image(core.Tensor(frame.colour.astype(np.float32) / 255))
        turn.append((depth, colour, intrinsics, pose))
    ready = cycle(turn)

    def integrate() -> None:
        depth, colour, intrinsics, pose = next(ready)
        near = volume.compute_unique_block_coordinates(
            depth, intrinsics, pose, 1.0, 2.0, TRUNCATION / GRID.spacing
        )
        volume.integrate(near, depth, colour, intrinsics, pose, 1.0, 2.0, TRUNCATION / GRID.spacing)

    integrate()
    if not len(volume.extract_point_cloud(0.0).point.positions):
        raise Unavailable("Open3D integrated nothing")
    return integrate


def uniform() -> Timed:
    """Open3D's dense voxels, of 4 mm so that they fit in memory."""
    import open3d as o3d

    kind, colour = o3d.pipelines.integration, o3d.pipelines.integration.TSDFVolumeColorType.RGB8
    volume = kind.UniformTSDFVolume(
        GRID.extent, DENSE, 4 * TRUNCATION, colour, np.array([-0.512, -0.512, -0.5])
    )
    ready = []
    for frame in frames():
        view = frame.camera
        image = o3d.geometry.RGBDImage.create_from_color_and_depth(
            o3d.geometry.Image(frame.colour), o3d.geometry.Image(frame.depth),
            depth_scale=1.0, depth_trunc=2.0, convert_rgb_to_intensity=False,
        )  # fmt: skip
        intrinsics = o3d.camera.PinholeCameraIntrinsic(
            view.width, view.height, view.fx, view.fy, view.cx, view.cy
        )
        ready.append((image, intrinsics, np.linalg.inv(view.T_world_camera)))
    turn = cycle(ready)
    volume.integrate(*next(turn))
    if not volume.extract_point_cloud().points:
        raise Unavailable("Open3D integrated nothing")
    return lambda: volume.integrate(*next(turn))


def labels() -> Timed:
    """Semantic fusion in height-map space."""
    running, turn, said = SemanticFusion().begin(GRID, CLASSES), cycle(frames()), distributions()
    return lambda: running.add(said, next(turn))


def labels_in_images() -> Timed:
    """Semantic fusion in image space, the height map at hand."""
    running, turn, said = ImageSpaceFusion().begin(GRID, CLASSES), cycle(frames()), distributions()
    known = known_heights()
    return lambda: running.add(said, next(turn), known)


def known_heights() -> HeightMap:
    """The map of all frames."""
    running = HeightFusion(GRID).begin()
    for frame in frames():
        running.add(frame)
    return running.height_map()


def eager() -> Timed:
    """Eager torch at the finest level."""
    logits = torch.zeros(GRID.vertices**2, CLASSES)
    said = torch.from_numpy(distributions()).flatten(1).T.contiguous()
    ready = [
        (torch.from_numpy(frame.depth).view(-1), torch.from_numpy(rays_of(frame.camera)).float(),
         torch.from_numpy(frame.camera.T_world_camera[:3, 3]).float())
        for frame in frames()
    ]  # fmt: skip
    turn = cycle(ready)
    return lambda: fuse_eagerly(logits, said, *next(turn))


def rays_of(view: Camera) -> np.ndarray:
    """World directions (H * W, 3)."""
    v, u = np.mgrid[: view.height, : view.width]
    local = np.stack([(u - view.cx) / view.fx, (v - view.cy) / view.fy, np.ones(u.shape)], -1)
    rays: np.ndarray = (local @ view.T_world_camera[:3, :3].T).reshape(-1, 3)
    return rays


def fuse_eagerly(
    logits: torch.Tensor,
    said: torch.Tensor,
    depth: torch.Tensor,
    rays: torch.Tensor,
    eye: torch.Tensor,
) -> None:
    """Eqs 4.5 to 4.10 with the same floor."""
    n, points = GRID.vertices, eye + depth[:, None] * rays
    column = (points[:, 0] - GRID.lower[0]) / GRID.spacing
    row = (GRID.lower[1] + GRID.extent - points[:, 1]) / GRID.spacing
    inside = (depth > 0) & (row >= 0) & (column >= 0) & (row < n - 1) & (column < n - 1)
    row, column, measured = row[inside], column[inside], said[inside]
    r, c = row.long(), column.long()
    f, g = row - r, column - c
    right = g >= f
    cell = r * n + c
    corners = (
        (cell, 1 - torch.maximum(f, g), torch.hypot(f, g)),
        (
            torch.where(right, cell + 1, cell + n),
            (f - g).abs(),
            torch.where(right, torch.hypot(f, 1 - g), torch.hypot(1 - f, g)),
        ),
        (cell + n + 1, torch.minimum(f, g), torch.hypot(1 - f, 1 - g)),
    )
    for vertex, weight, far in corners:
        share = (1 - CLASSES * 1e-3) * torch.exp(-far)[:, None]
        likelihood = share * measured + (1 - share) / CLASSES
        logits.index_add_(0, vertex, weight[:, None] * likelihood.log())


JOBS = [
    Job(
        "height fusion of a 320 x 240 frame, 1025 x 1025 vertices",
        heights,
        {
            "open3d VoxelBlockGrid, 1 mm": blocks,
            "open3d UniformTSDFVolume, 256^3 of 4 mm": uniform,
        },
        repeats=36,
    ),
    Job("height map read out, 1025 x 1025 vertices", read_out),
    Job(
        f"semantic fusion of a 320 x 240 frame, {CLASSES} classes, map space",
        labels,
        {"torch eager, index_add_": eager},
        repeats=36,
    ),
    Job(
        f"semantic fusion of a 320 x 240 frame, {CLASSES} classes, image space",
        labels_in_images,
        {"torch eager, index_add_ (map space)": eager},
        repeats=36,
    ),
]
