"""Pictures of predicted objects: traced surfaces with soft light, shadows and outlines."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from numpy.typing import NDArray
from scipy import ndimage
from torch import Tensor

from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, Float32, GridSpec, Int32
from scenefw.kernels import drawn_surfaces
from scenefw.kernels.cameras import stack_cameras
from scenefw.kernels.compile import float32
from scenefw.kernels.drawn_surfaces import SIDE
from scenefw.kernels.soft_light import floor_map
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw.report.palette import Colour
from scenefw.report.surfaces import Met, Surfaces, pixel_places, view_of

Picture = NDArray[np.float32]

_FILLED = 0.8  # of the picture
_BLURRED = 4  # voxels beyond which a blurred instance is 0
_GREY = (0.62, 0.62, 0.62)
_FLOOR_REACH = 0.8  # m
_FLOOR_SAMPLES = 160  # of 1 cm, a voxel of the finest usual grid


@dataclass(frozen=True)
class Solid:
    """A volume to draw.

    Args:
        tsdf: (X, Y, Z) metres.
        instances: (X, Y, Z) labels; label i has colour i - 1, 0 and beyond are grey.
        grid: the voxel grid of both.
        colours: red, green, blue in [0, 1] by label.
        visibility: (X, Y, Z) in [0, 1]; surfaces are pale where it is 0. None = nowhere.
        surfaces: of the objects, which are seen in place of the volume's; shadows are its all the
            same. None: the volume's are seen.
        hollow: (X, Y, Z) distances in which hollow objects are so (m), by which objects are lit:
            light falls into them, but thin walls cast no shadow. The floor is lit by `tsdf`, in
            which they have a lid on. None: nothing is hollow.
        truncated: distances end at the truncation, as those of volumes do.
    """

    tsdf: Float32
    instances: Int32
    grid: GridSpec
    colours: list[Colour]
    visibility: Float32 | None = None
    surfaces: Surfaces | None = None
    hollow: Float32 | None = None
    truncated: bool = True

    @cached_property
    def far(self) -> tuple[Float32, Float32]:
        """Distances (X, Y, Z) by which the floor and objects are lit (m), for all its pictures."""
        fields = [self.tsdf] if self.hollow is None else [self.tsdf, self.hollow]
        if self.truncated:
            fields = [_far_distance(field, self.grid) for field in fields]
        return fields[0], fields[-1]


def draw(solid: Solid, camera: Camera, *, reach: float = 0.62) -> Picture:
    """RGB (H, W, 3) in [0, 1] of a volume on a light floor that fades into white.

    The light comes over the camera's left shoulder. Ambient occlusion and soft shadows are read off
    the distance field (Evans 2006; Quilez 2010). Edges are averaged over 2 x 2 rays per pixel.

    Args:
        solid: what to draw.
        camera: from where.
        reach: the floor fades out this far from the z axis (m).
    """
    if solid.surfaces is None:
        return _draw_volume(solid, camera, reach)
    return _draw_surfaces(solid, solid.surfaces, camera, reach)


def _draw_surfaces(solid: Solid, surfaces: Surfaces, camera: Camera, reach: float) -> Picture:
    """One ray per pixel, and four where neighbours show something else."""
    places = pixel_places(camera)
    met = surfaces.met(camera, places)
    light = _Light.of(solid, camera)
    picture = _coloured(solid, light, met, places, camera, reach)
    pixels = torch.nonzero(_varied(met, camera, reach))[:, 0]
    corners = (torch.arange(SIDE) + 0.5) / SIDE - 0.5
    around = torch.cartesian_prod(corners, corners).flip(1)  # columns first
    finer = (places[pixels, None] + around).view(-1, 2)
    more = surfaces.met(camera, finer)
    _blend(picture, pixels, met, more, _coloured(solid, light, more, finer, camera, reach), camera)
    return picture.view(camera.height, camera.width, 3).numpy()


def _draw_volume(solid: Solid, camera: Camera, reach: float) -> Picture:
    """The zero level of its distances, by four rays per pixel."""
    fine = camera.resized(camera.width * SIDE, camera.height * SIDE)
    surface = SphereTracer(floor=True).render_surface(
        torch.from_numpy(np.ascontiguousarray(solid.tsdf))[None, None],
        torch.from_numpy(np.ascontiguousarray(solid.instances))[None],
        solid.grid,
        stack_cameras([fine]),
    )
    depth, normals = surface.depth[0], surface.normals[0].movedim(0, -1)
    points = _points(depth.numpy(), fine)
    on_object = (depth.numpy() > 0) & (points[..., 2] >= 1e-3)
    labels = np.zeros(depth.shape, dtype=np.int32)
    object_labels = _smooth_labels(solid, points[on_object])
    # What is no object's is grey, as labels beyond the colours are; 0 is the floor here
    labels[on_object] = np.where(object_labels > 0, object_labels, len(solid.colours) + 1)
    rays = [_by_pixel(channel) for channel in (depth, normals, torch.from_numpy(labels))]
    places = _by_pixel(pixel_places(fine).view(fine.height, fine.width, 2))
    met = Met(*rays)
    colours = _coloured(solid, _Light.of(solid, camera), met, places, fine, reach)
    pixel_hits = Met(*(channel[:: SIDE * SIDE].contiguous() for channel in rays))
    picture = torch.empty(camera.height * camera.width, 3)
    _blend(picture, torch.arange(len(picture)), pixel_hits, met, colours, camera)
    return picture.view(camera.height, camera.width, 3).numpy()


def _by_pixel(rays: Tensor) -> Tensor:
    """Rays (H, W, ...) as (N, ...), with those of a pixel one after the other."""
    height, width, *channels = rays.shape
    blocks = rays.reshape(height // SIDE, SIDE, width // SIDE, SIDE, *channels)
    return blocks.transpose(1, 2).reshape(-1, *channels).contiguous()


@dataclass(frozen=True)
class _Light:
    """Light on a scene, from over a camera's left shoulder.

    Attributes:
        key: direction to it, of length 1.
        floor: brightness of the floor, a map of the square |x|, |y| <= `_FLOOR_REACH`.
        objects: (X, Y, Z) distances by which objects are lit (m).
    """

    key: tuple[float, float, float]
    floor: Tensor
    objects: Tensor

    @classmethod
    def of(cls, solid: Solid, camera: Camera) -> "_Light":
        right, down, forward = camera.T_world_camera[:3, :3].T
        towards = -0.55 * right - 0.5 * down - 0.35 * forward + np.array([0.0, 0.0, 0.9])
        x, y, z = (float(component) for component in towards / np.linalg.norm(towards))
        fields = [torch.from_numpy(np.ascontiguousarray(field)) for field in solid.far]
        floor = floor_map(fields[0], solid.grid, _FLOOR_REACH, _FLOOR_SAMPLES, (x, y, z))
        return cls((x, y, z), floor, fields[1])


def _coloured(
    solid: Solid, light: _Light, met: Met, places: Tensor, camera: Camera, reach: float
) -> Tensor:
    """Colours (N, 3) of what rays meet; white where they meet nothing."""
    grid = solid.grid
    palette = np.vstack([_GREY, np.reshape(solid.colours, (-1, 3))]).astype(np.float32)
    pale = solid.visibility is not None
    visibility = torch.from_numpy(np.ascontiguousarray(solid.visibility)) if pale else light.objects
    colours = torch.empty(len(places), 3)
    drawn_surfaces.colour(
        len(places), places, view_of(camera), met.depth, met.facing, met.labels,
        light.floor, np.float32(_FLOOR_REACH), light.objects.view(-1), grid.resolution,
        float32(grid.voxel_size, *grid.lower), float32(*light.key), torch.from_numpy(palette),
        visibility.view(-1), pale, np.float32(reach), colours,
    )  # fmt: skip
    return colours


def _varied(met: Met, camera: Camera, reach: float) -> Tensor:
    """Pixels (N,) beside which something else is seen, or a line of the floor."""
    mask = torch.empty(len(met.depth), dtype=torch.bool)
    drawn_surfaces.varied(
        camera.height, view_of(camera), (camera.width, camera.height), met.depth, met.facing,
        met.labels, np.float32(reach), mask,
    )  # fmt: skip
    return mask


def _blend(
    picture: Tensor, pixels: Tensor, met: Met, more: Met, colours: Tensor, camera: Camera
) -> None:
    """Some pixels of a picture (N, 3) become the mean of four rays, with outlines."""
    numbers = torch.full((len(met.depth),), -1, dtype=torch.int32)
    numbers[pixels] = torch.arange(len(pixels), dtype=torch.int32)
    drawn_surfaces.blend(
        len(pixels), pixels, numbers, camera.width, more.labels, more.depth, colours,
        met.labels, met.depth, picture,
    )  # fmt: skip


def turned(camera: Camera, points: NDArray[np.float64], turn: float) -> Camera:
    """The camera moved about the z axis, so near that the points fill four fifths of the picture.

    Args:
        camera: gives image size and the first point of view; the elevation is kept within 20 to 60
            degrees.
        points: (N, 3) to show (m).
        turn: degrees about the z axis.
    """
    x, y, z = camera.T_world_camera[:3, 3]
    azimuth = np.arctan2(y, x) + np.radians(turn)
    elevation = np.clip(np.arctan2(z, np.hypot(x, y)), np.radians(20), np.radians(60))
    flat = np.cos(elevation)
    direction = np.array([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])
    points = points if len(points) else np.array([[0.2, 0.2, 0.0], [-0.2, -0.2, 0.2]])
    target = (points.min(axis=0) + points.max(axis=0)) / 2
    rotation = look_at(target + direction, target)[:3, :3]
    right, down, forward = ((points - target) @ rotation).T
    focal = 1.6 * camera.height
    distances = [
        focal * np.abs(sideways) / (_FILLED * side / 2) - forward
        for sideways, side in ((right, camera.width), (down, camera.height))
    ]
    distance = max(float(np.max(distances)), 0.4)
    middle = ((camera.width - 1) / 2, (camera.height - 1) / 2)
    pose = look_at(target + distance * direction, target)
    return Camera(camera.width, camera.height, focal, focal, *middle, pose)


def _points(depth: Float32, camera: Camera) -> Float32:
    u = ((np.arange(camera.width) - camera.cx) / camera.fx).astype(np.float32)
    v = ((np.arange(camera.height)[:, None] - camera.cy) / camera.fy).astype(np.float32)
    local = np.stack([u * depth, v * depth, depth], axis=-1)
    pose = camera.T_world_camera.astype(np.float32)
    return local @ pose[:3, :3].T + pose[:3, 3]


def _smooth_labels(solid: Solid, points: Float32) -> NDArray[np.int64]:
    """Labels at points, with borders rounder than voxels: the strongest blurred instance wins."""
    voxels = solid.grid.to_voxels(points.astype(np.float64))
    best = np.full(len(points), 1e-3, dtype=np.float32)
    labels = np.zeros(len(points), dtype=np.int64)
    for label, box in enumerate(ndimage.find_objects(solid.instances), start=1):
        if box is None:
            continue
        lower = np.array([max(side.start - _BLURRED, 0) for side in box])
        upper = np.array([side.stop + _BLURRED for side in box])
        object_mask = solid.instances[tuple(map(slice, lower, upper))] == label
        candidates = np.flatnonzero(((voxels > lower - 1) & (voxels < upper)).all(axis=1))
        strength = ndimage.map_coordinates(
            ndimage.gaussian_filter(object_mask.astype(np.float32), 0.8),
            (voxels[candidates] - lower).T,
            order=1,
            mode="nearest",
        )
        stronger = strength > best[candidates]
        best[candidates[stronger]], labels[candidates[stronger]] = strength[stronger], label
    return labels


def _far_distance(tsdf: Float32, grid: GridSpec) -> Float32:
    """A TSDF continued beyond its truncation by a distance transform, objects alone."""
    far = tsdf > 0.9 * grid.truncation
    if far.all():
        return np.full(tsdf.shape, grid.extent, dtype=np.float32)
    excess = ndimage.distance_transform_edt(far) * grid.voxel_size
    return np.where(far, 0.9 * grid.truncation + excess, tsdf).astype(np.float32)
