"""Pictures of predicted objects: traced surfaces with soft light, shadows and outlines."""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from scipy import ndimage
from torch.nn import functional

from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, Float32, GridSpec, Int32
from scenefw.kernels.cameras import stack_cameras
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw.report.palette import Colour
from scenefw.report.surfaces import Surfaces

Picture = NDArray[np.float32]

_SUPERSAMPLING = 2
_ALIKE_DEPTH, _ALIKE_NORMAL = 0.01, 0.95  # m and cosine: of rays that share their light
_SKY = -9
_FLOOR_REACH = 0.8  # m
_FLOOR_SAMPLES = 224
_FILLED = 0.8  # of the picture
_BLURRED = 4  # voxels beyond which a blurred instance is 0
_GREY = (0.62, 0.62, 0.62)
_PALE = np.array([0.93, 0.93, 0.94], dtype=np.float32)
_HIDDEN = 0.4  # share of its colour that an unseen surface keeps
_FLOOR = (0.90, 0.90, 0.91)
_GRID_LINES = 0.05  # m
_OCCLUSION_STEPS = (0.008, 0.02, 0.045, 0.08)  # m along the normal
_SHADOW_STEPS = tuple(np.geomspace(0.012, 0.35, 9).tolist())  # m towards the light
_SHADOW_SOFTNESS = 9.0


@dataclass(frozen=True)
class Solid:
    """A volume to draw.

    Args:
        tsdf: (X, Y, Z) metres.
        instances: (X, Y, Z) labels; label i has colour i - 1, 0 and beyond are grey.
        grid: the voxel grid of both.
        colours: red, green, blue in [0, 1] by label.
        seen: (X, Y, Z) in [0, 1]; surfaces are pale where it is 0. None = nowhere.
        surfaces: of the objects, which are seen in place of the volume's; shadows are its all the
            same. None: the volume's are seen.
        hollow: (X, Y, Z) distances in which hollow objects are so (m), by which these are lit;
            thin walls cast no shadow in it. None: nothing is hollow.
        hollow_labels: labels of those objects.
    """

    tsdf: Float32
    instances: Int32
    grid: GridSpec
    colours: list[Colour]
    seen: Float32 | None = None
    surfaces: Surfaces | None = None
    hollow: Float32 | None = None
    hollow_labels: tuple[int, ...] = ()


def draw(solid: Solid, camera: Camera, *, reach: float = 0.62) -> Picture:
    """RGB (H, W, 3) in [0, 1] of a volume on a light floor that fades into white.

    The light comes over the camera's left shoulder. Ambient occlusion and soft shadows are read off
    the distance field (Evans 2006; Quilez 2010). Edges are averaged over 2 x 2 rays per pixel; rays
    of a pixel that meet one surface share its light.

    Args:
        solid: what to draw.
        camera: from where.
        reach: the floor fades out this far from the z axis (m).
    """
    fine = camera.resized(camera.width * _SUPERSAMPLING, camera.height * _SUPERSAMPLING)
    depth, normals, labels, is_floor = _first_surfaces(solid, fine)
    points = _points(depth, fine)
    hit = (depth > 0) & ~(is_floor & (np.hypot(points[..., 0], points[..., 1]) > reach))
    on_object = hit & ~is_floor
    picture = np.ones((*depth.shape, 3), dtype=np.float32)
    lender = _lenders(np.where(hit, labels + 1 - 2 * is_floor, _SKY), depth, normals)
    lends = np.zeros(depth.size, dtype=bool)
    lends[lender[hit]] = True
    lit = lends.reshape(depth.shape)
    number = np.cumsum(lit)[lender[hit]] - 1
    light = _light(solid, points[lit], normals[lit], labels[lit], is_floor[lit], fine)[number]
    colour = _base_colours(solid, labels[hit], points[hit], is_floor[hit])
    if solid.seen is not None:
        share = _seen_share(solid.seen, solid.grid, points[lit])[number]
        colour = np.where(is_floor[hit, None], colour, _PALE + (colour - _PALE) * share)
    shaded = np.clip(colour * light, 0, 1)
    fade = _fade(points[hit], is_floor[hit], reach)[:, None]
    picture[hit] = shaded * (1 - fade) + fade
    picture = _outlined(picture, np.where(on_object, labels + 1, 0), depth)
    return _reduced(picture)


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
    needed = [
        focal * np.abs(sideways) / (_FILLED * side / 2) - forward
        for sideways, side in ((right, camera.width), (down, camera.height))
    ]
    distance = max(float(np.max(needed)), 0.4)
    middle = ((camera.width - 1) / 2, (camera.height - 1) / 2)
    pose = look_at(target + distance * direction, target)
    return Camera(camera.width, camera.height, focal, focal, *middle, pose)


def _first_surfaces(
    solid: Solid, camera: Camera
) -> tuple[Float32, Float32, NDArray[np.int64], NDArray[np.bool_]]:
    """Depth (H, W), normals (H, W, 3), labels (H, W) and which pixels (H, W) show the floor."""
    if solid.surfaces is not None:
        depth, normals, owners = solid.surfaces.seen_from(camera)
        labels: NDArray[np.int64] = owners.astype(np.int64)
        return depth, normals, labels, (depth > 0) & (owners == 0)
    surface = SphereTracer(floor=True).render_surface(
        torch.from_numpy(np.ascontiguousarray(solid.tsdf))[None, None],
        torch.from_numpy(np.ascontiguousarray(solid.instances))[None],
        solid.grid,
        stack_cameras([camera]),
    )
    depth = surface.depth[0].numpy()
    points = _points(depth, camera)
    is_floor = (depth > 0) & (points[..., 2] < 1e-3)
    labels = np.zeros(depth.shape, dtype=np.int64)
    on_object = (depth > 0) & ~is_floor
    labels[on_object] = _smooth_labels(solid, points[on_object])
    return depth, np.moveaxis(surface.normals[0].numpy(), 0, -1), labels, is_floor


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
        own = solid.instances[tuple(map(slice, lower, upper))] == label
        near = np.flatnonzero(((voxels > lower - 1) & (voxels < upper)).all(axis=1))
        strength = ndimage.map_coordinates(
            ndimage.gaussian_filter(own.astype(np.float32), 0.8),
            (voxels[near] - lower).T,
            order=1,
            mode="nearest",
        )
        stronger = strength > best[near]
        best[near[stronger]], labels[near[stronger]] = strength[stronger], label
    return labels


def _base_colours(
    solid: Solid, labels: NDArray[np.int64], points: Float32, is_floor: NDArray[np.bool_]
) -> Float32:
    table = np.vstack([_GREY, np.reshape(solid.colours, (-1, 3))]).astype(np.float32)
    colour = table[np.where(labels < len(table), labels, 0)]
    colour[is_floor] = _FLOOR
    x, y = np.abs((points[is_floor, :2] + _GRID_LINES) % (2 * _GRID_LINES) - _GRID_LINES).T
    on_lines = np.flatnonzero(is_floor)[np.minimum(x, y) < 0.0011]
    colour[on_lines] *= 0.93
    return colour


def _lenders(surfaces: NDArray[np.int64], depth: Float32, normals: Float32) -> NDArray[np.int64]:
    """The ray (H, W) whose light each ray takes: the first of its block if both are alike.

    Args:
        surfaces: (H, W) what rays meet, `_SKY` = nothing.
        depth: (H, W) metres.
        normals: (H, W, 3).
    """
    height, width = depth.shape
    own = np.arange(height * width).reshape(height, width)
    n = _SUPERSAMPLING
    rows, columns = (np.arange(size) // n * n for size in depth.shape)
    first = np.ix_(rows, columns)
    alike = (
        (surfaces == surfaces[first])
        & (np.abs(depth - depth[first]) < _ALIKE_DEPTH)
        & (np.einsum("hwc,hwc->hw", normals, normals[first]) > _ALIKE_NORMAL)
    )
    return np.where(alike, own[first], own)


def _seen_share(seen: Float32, grid: GridSpec, points: Float32) -> Float32:
    """Share (N, 1) of its colour that a surface keeps, by how much of it is seen."""
    share = np.clip(2 * _sample(seen, grid, points) - 0.5, 0, 1)[:, None]
    return (_HIDDEN + (1 - _HIDDEN) * share).astype(np.float32)


def _light(
    solid: Solid,
    points: Float32,
    normals: Float32,
    labels: NDArray[np.int64],
    is_floor: NDArray[np.bool_],
    camera: Camera,
) -> Float32:
    """Brightness (N, 1) of points on objects and floor."""
    right, down, forward = camera.T_world_camera[:3, :3].T
    key = -0.55 * right - 0.5 * down - 0.35 * forward + np.array([0.0, 0.0, 0.9])
    key = (key / np.linalg.norm(key)).astype(np.float32)
    grid, brightness = solid.grid, np.empty(len(points), dtype=np.float32)
    field = _far_distance(solid.tsdf, grid)
    hollow = np.isin(labels, solid.hollow_labels) & ~is_floor
    objects = ~is_floor & ~hollow
    brightness[objects] = _brightness(field, grid, points[objects], normals[objects], key)
    brightness[is_floor] = _floor_brightness(field, grid, points[is_floor], key)
    if solid.hollow is not None and hollow.any():
        field = _far_distance(solid.hollow, grid)
        brightness[hollow] = _brightness(field, grid, points[hollow], normals[hollow], key)
    return brightness[:, None]


def _floor_brightness(field: Float32, grid: GridSpec, points: Float32, key: Float32) -> Float32:
    """Brightness of floor points (N, 3), read off a map: it varies slowly and pixels are many."""
    axis = np.linspace(-_FLOOR_REACH, _FLOOR_REACH, _FLOOR_SAMPLES, dtype=np.float32)
    x, y = np.meshgrid(axis, axis)
    cells = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    up = np.broadcast_to(np.array([0, 0, 1], dtype=np.float32), cells.shape)
    light = _brightness(field, grid, cells, up, key).reshape(1, 1, len(axis), len(axis))
    where = torch.from_numpy(points[:, :2] / np.float32(_FLOOR_REACH))[None, :, None]
    found = functional.grid_sample(
        torch.from_numpy(light), where, padding_mode="border", align_corners=True
    )
    return found.view(-1).numpy()


def _brightness(
    field: Float32, grid: GridSpec, points: Float32, normals: Float32, key: Float32
) -> Float32:
    """Brightness (N,) from a key light with shadow, the sky, and the occlusion of both."""
    lambert = np.clip(normals @ key, 0, 1)
    shadow = _shadow(field, grid, points + np.float32(0.004) * normals, key)
    sky = 0.5 + 0.5 * normals[:, 2]
    ambient = (0.42 + 0.22 * sky) * _occlusion(field, grid, points, normals)
    return (ambient + 0.46 * lambert * shadow).astype(np.float32)


def _far_distance(tsdf: Float32, grid: GridSpec) -> Float32:
    """A TSDF continued beyond its truncation by a distance transform, objects alone."""
    far = tsdf > 0.9 * grid.truncation
    if far.all():
        return np.full(tsdf.shape, grid.extent, dtype=np.float32)
    beyond = ndimage.distance_transform_edt(far) * grid.voxel_size
    return np.where(far, 0.9 * grid.truncation + beyond, tsdf).astype(np.float32)


def _occlusion(field: Float32, grid: GridSpec, points: Float32, normals: Float32) -> Float32:
    blocked = np.zeros(len(points), dtype=np.float32)
    for i, step in enumerate(_OCCLUSION_STEPS):
        ahead = points + step * normals
        free = np.minimum(_sample(field, grid, ahead), np.abs(ahead[:, 2]))
        blocked += 0.5**i * np.clip(1 - free / step, 0, 1)
    return np.clip(1 - 0.6 * blocked / 1.3, 0.35, 1)


def _shadow(field: Float32, grid: GridSpec, points: Float32, key: Float32) -> Float32:
    lit = np.ones(len(points), dtype=np.float32)
    for step in _SHADOW_STEPS:
        free = _sample(field, grid, points + step * key)
        lit = np.minimum(lit, np.clip(_SHADOW_SOFTNESS * free / step, 0, 1))
    return lit


def _sample(field: Float32, grid: GridSpec, points: Float32) -> Float32:
    """Trilinear values at world points (N, 3), the outermost ones beyond the cube."""
    centre = np.asarray(grid.lower, dtype=np.float32) + np.float32(grid.extent / 2)
    scaled = torch.from_numpy((points - centre)[:, ::-1] * np.float32(2 / grid.extent))
    volume = torch.from_numpy(np.ascontiguousarray(field))[None, None]
    values = functional.grid_sample(
        volume, scaled[None, :, None, None], padding_mode="border", align_corners=False
    )
    return values.view(-1).numpy()


def _fade(points: Float32, is_floor: NDArray[np.bool_], reach: float) -> Float32:
    radius = np.hypot(points[:, 0], points[:, 1]) / reach
    return np.where(is_floor, np.clip((radius - 0.45) / 0.55, 0, 1) ** 1.5, 0.0)


def _outlined(picture: Float32, labels: NDArray[np.int64], depth: Float32) -> Float32:
    """Darkens pixels where the object changes, or where depth jumps within it."""
    edge = np.zeros(labels.shape, dtype=bool)
    jump = 0.03
    for axis in (0, 1):
        change = np.diff(labels, axis=axis) != 0
        step = (np.abs(np.diff(depth, axis=axis)) > jump) & (np.delete(labels, 0, axis) > 0)
        pad = [(0, 1) if a == axis else (0, 0) for a in (0, 1)]
        edge |= np.pad(change | step, pad)
    picture[edge] *= 0.45
    return picture


def _reduced(picture: Float32) -> Float32:
    """Mean of each block of rays."""
    n = _SUPERSAMPLING
    parts = [picture[i::n, j::n] for i in range(n) for j in range(n)]
    return sum(parts[1:], start=parts[0]) / np.float32(n * n)
