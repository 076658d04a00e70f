"""Views of table-top scenes beside open3d's ray casting, which gives depth alone."""

from collections.abc import Callable

import numpy as np
import torch

from benchmarks.harness import Job
from scenefw.core.height_maps import HeightGrid
from scenefw.core.tabletop import TabletopGeometry
from scenefw.core.types import Camera
from scenefw.kernels.meshes import Tree
from scenefw.renderers.mesh_raycaster import MeshRaycaster
from scenefw_tabletops.data.table_scenes import TabletopScenes
from scenefw_tabletops.scenes.desk import DeskGenerator
from scenefw_tabletops.scenes.tabletop import TabletopGenerator
from scenefw_tabletops.shapes.desk.library import DeskModels
from scenefw_tabletops.shapes.tabletop.library import ProceduralModels

VIEWS = 10


def scene() -> tuple[TabletopGeometry, list[Camera]]:
    """The first scene and its first views."""
    source = TabletopScenes(TabletopGenerator(ProceduralModels()), MeshRaycaster())
    return source.scenes.geometry(source.scene(0)), [source.camera(0, i) for i in range(VIEWS)]


def rays_of(camera: Camera) -> np.ndarray:
    """(H W, 6) float32; distances along them are z-depths."""
    v, u = np.mgrid[: camera.height, : camera.width]
    local = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)])
    ahead = np.moveaxis(local, 0, -1).reshape(-1, 3) @ camera.T_world_camera[:3, :3].T
    eye = np.broadcast_to(camera.T_world_camera[:3, 3], ahead.shape)
    return np.concatenate([eye, ahead], axis=1).astype(np.float32)


def render() -> Callable[[], object]:
    """Depth, labels and colour with shadows."""
    geometry, cameras = scene()
    renderer = MeshRaycaster()
    return lambda: list(renderer.frames(geometry, cameras))


def render_cluttered() -> Callable[[], object]:
    """The same of a cluttered table."""
    source = TabletopScenes(DeskGenerator(DeskModels()), MeshRaycaster())
    geometry = source.scenes.geometry(source.scene(0))
    cameras = [source.camera(0, i) for i in range(VIEWS)]
    renderer = MeshRaycaster()
    return lambda: list(renderer.frames(geometry, cameras))


def cast() -> Callable[[], object]:
    """Depth alone."""
    geometry, cameras = scene()
    tree, rays = Tree(geometry.corners), [torch.from_numpy(rays_of(c)) for c in cameras]
    return lambda: [tree.cast(ray)[0] for ray in rays]


def cast_open3d() -> Callable[[], object]:
    """Embree through open3d, depth alone, the table as two triangles."""
    import open3d as o3d

    geometry, cameras = scene()
    world = o3d.t.geometry.RaycastingScene()
    numbers = np.arange(3 * len(geometry.corners), dtype=np.uint32).reshape(-1, 3)
    world.add_triangles(geometry.corners.reshape(-1, 3), numbers)
    table = np.array([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], dtype=np.float32)
    world.add_triangles(table, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32))
    rays = [o3d.core.Tensor(rays_of(camera)) for camera in cameras]
    return lambda: [world.cast_rays(ray)["t_hit"].numpy() for ray in rays]


def build() -> Callable[[], object]:
    """The tree of boxes of a scene."""
    geometry, _ = scene()
    return lambda: Tree(geometry.corners)


def map_truth() -> Callable[[], object]:
    """The ground truth of a scene."""
    geometry, _ = scene()
    renderer = MeshRaycaster()
    return lambda: renderer.height_map(geometry, HeightGrid())


JOBS = [
    Job(
        f"{VIEWS} table-top views 320 x 240, colour and labels",
        render,
        {"open3d ray casting, depth alone": cast_open3d},
    ),
    Job(
        f"{VIEWS} table-top views 320 x 240, depth alone",
        cast,
        {"open3d ray casting": cast_open3d},
    ),
    Job(
        f"{VIEWS} views 320 x 240 of a cluttered table, colour and labels",
        render_cluttered,
        {"of an easy table": render},
    ),
    Job("tree of a table-top scene", build),
    Job("table-top ground truth 1025 x 1025", map_truth),
]
