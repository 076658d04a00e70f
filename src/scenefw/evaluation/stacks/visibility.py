"""Which part of a surface a camera sees (thesis 5.2.4, "Visible surface evaluation")."""

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from scenefw.core.batches import CameraBatch, SceneVolumes
from scenefw.core.protocols import Renderer, SurfaceRenderer
from scenefw.core.types import Camera, GridSpec, TriangleMesh
from scenefw.kernels.cameras import stack_cameras
from scenefw.metrics.sampling import face_areas, faces_of

_LEAST_COSINE = 0.1


class VisibleSurface:
    """Keeps the faces of a mesh that are in front in the depth image of its own TSDF.

    The thesis keeps every face that is the first one hit by some ray of the camera. Here a face is
    kept if it looks towards the camera and its centre is no deeper than the rendered depth there,
    within half a voxel and what the depth of the slanted face changes over one pixel.

    Args:
        renderer: of TSDF grids; with a floor, what lies below it is hidden.
        scale: size of the depth image relative to the camera's own.
    """

    def __init__(self, renderer: Renderer, scale: float = 0.5) -> None:
        self.renderer = renderer
        self.scale = scale

    def part(
        self, mesh: TriangleMesh, tsdf: Tensor, grid: GridSpec, camera: Camera
    ) -> TriangleMesh:
        """The visible part of the surface `mesh` of a TSDF (X, Y, Z) in metres."""
        small = camera.resized(
            max(1, round(camera.width * self.scale)), max(1, round(camera.height * self.scale))
        )
        cameras = stack_cameras([small], tsdf.device)
        depth = self.renderer.render(tsdf[None, None].float().contiguous(), grid, cameras)[0]
        return faces_of(mesh, _visible(mesh, depth.cpu().numpy(), small, 0.5 * grid.voxel_size))


def visible_share(mesh: TriangleMesh, visible: TriangleMesh) -> float:
    """Area of the visible part over the whole area."""
    return float(face_areas(visible).sum() / face_areas(mesh).sum())


def shown_pixels(
    renderer: SurfaceRenderer, volumes: SceneVolumes, grid: GridSpec, cameras: CameraBatch
) -> dict[int, int]:
    """How many pixels of an image show each object of one scene, by its label.

    Args:
        renderer: says whose surface a pixel shows.
        volumes: of the scene.
        grid: of these.
        cameras: one, that takes the image.
    """
    rendering = renderer.render_surface(volumes.tsdf, volumes.instances, grid, cameras)
    pixel_labels = rendering.instances.clamp_min(0).cpu().numpy()
    labels = volumes.instances.cpu().numpy()
    counts = np.bincount(pixel_labels.ravel(), minlength=int(labels.max(initial=0)) + 1)
    return {int(label): int(counts[label]) for label in np.unique(labels[labels > 0])}


def _visible(
    mesh: TriangleMesh, depth: NDArray[np.float32], camera: Camera, tolerance: float
) -> NDArray[np.bool_]:
    rotation, position = camera.T_world_camera[:3, :3], camera.T_world_camera[:3, 3]
    a, b, c = np.moveaxis((mesh.vertices[mesh.faces] - position) @ rotation, 1, 0)
    centre = (a + b + c) / 3
    normal = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normal, axis=1) * np.linalg.norm(centre, axis=1)
    cosine = -(normal * centre).sum(axis=1) / np.maximum(lengths, 1e-20)
    z = centre[:, 2]
    ahead = np.maximum(z, 1e-6)
    u = np.rint(centre[:, 0] / ahead * camera.fx + camera.cx).astype(int)
    v = np.rint(centre[:, 1] / ahead * camera.fy + camera.cy).astype(int)
    inside = (z > 0) & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    nearest = depth[np.clip(v, 0, camera.height - 1), np.clip(u, 0, camera.width - 1)]
    slope = np.sqrt(np.maximum(1 - cosine**2, 0)) / np.maximum(cosine, _LEAST_COSINE)
    reach = tolerance + slope * z / camera.fx
    # 0 is a ray that hits nothing, next to a silhouette: the face's own pixel tells no more.
    return inside & (cosine > 0) & ((nearest == 0) | (z <= nearest + reach))
