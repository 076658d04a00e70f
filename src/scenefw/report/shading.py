"""Pictures of predicted objects: traced surfaces with soft light, shadows and outlines."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from numpy.typing import NDArray
from scipy import ndimage

from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, Float32, GridSpec, Int32
from scenefw.kernels.cameras import stack_cameras
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw.report.light import brightness_of, far_distance, floor_brightness, sample
from scenefw.report.palette import Colour
from scenefw.report.surfaces import Surfaces, directions

Picture = NDArray[np.float32]

_SUPERSAMPLING = 2
_ALIKE_DEPTH, _ALIKE_NORMAL = 0.01, 0.95  # m and cosine: of rays that share their light
_SKY = -9
_FILLED = 0.8  # of the picture
_BLURRED = 4  # voxels beyond which a blurred instance is 0
_GREY = (0.62, 0.62, 0.62)
_PALE = np.array([0.93, 0.93, 0.94], dtype=np.float32)
_HIDDEN = 0.4  # share of its colour that an unseen surface keeps
_FLOOR = (0.90, 0.90, 0.91)
_GRID_LINES, _LINE = 0.05, 0.0011  # m: half their distance, and half their width
_JUMP, _OUTLINE = 0.03, 0.45  # m within an object that have an outline; how bright that is


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
        hollow: (X, Y, Z) distances in which hollow objects are so (m), by which objects are lit:
            light falls into them, but thin walls cast no shadow. The floor is lit by `tsdf`, in
            which they have a lid on. None: nothing is hollow.
    """

    tsdf: Float32
    instances: Int32
    grid: GridSpec
    colours: list[Colour]
    seen: Float32 | None = None
    surfaces: Surfaces | None = None
    hollow: Float32 | None = None

    @cached_property
    def far(self) -> tuple[Float32, Float32]:
        """Distances (X, Y, Z) by which the floor and objects are lit (m), for all its pictures."""
        floor = far_distance(self.tsdf, self.grid)
        return floor, floor if self.hollow is None else far_distance(self.hollow, self.grid)


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
    if solid.surfaces is not None:
        return draw_surfaces(solid, solid.surfaces, camera, reach)
    fine = camera.resized(camera.width * _SUPERSAMPLING, camera.height * _SUPERSAMPLING)
    surface = SphereTracer(floor=True).render_surface(
        torch.from_numpy(np.ascontiguousarray(solid.tsdf))[None, None],
        torch.from_numpy(np.ascontiguousarray(solid.instances))[None],
        solid.grid,
        stack_cameras([fine]),
    )
    depth = surface.depth[0].numpy()
    normals = np.moveaxis(surface.normals[0].numpy(), 0, -1)
    points = _points(depth, fine)
    is_floor = (depth > 0) & (points[..., 2] < 1e-3)
    hit = (depth > 0) & ~(is_floor & (np.hypot(points[..., 0], points[..., 1]) > reach))
    labels = np.zeros(depth.shape, dtype=np.int64)
    on_object = hit & ~is_floor
    labels[on_object] = _smooth_labels(solid, points[on_object])
    picture = np.ones((*depth.shape, 3), dtype=np.float32)
    lender = _lenders(np.where(hit, labels + 1 - 2 * is_floor, _SKY), depth, normals)
    lends = np.zeros(depth.size, dtype=bool)
    lends[lender[hit]] = True
    lit = lends.reshape(depth.shape)
    number = np.cumsum(lit)[lender[hit]] - 1
    light = _light(solid, points[lit], normals[lit], is_floor[lit], fine)[number]
    colour = _base_colours(solid, labels[hit], points[hit], is_floor[hit])
    if solid.seen is not None:
        share = _seen_share(solid.seen, solid.grid, points[lit])[number]
        colour = np.where(is_floor[hit, None], colour, _PALE + (colour - _PALE) * share)
    picture[hit] = _faded(np.clip(colour * light, 0, 1), points[hit], is_floor[hit], reach)
    edge = _outline(np.where(on_object, labels + 1, 0), depth)
    picture[edge] *= _OUTLINE
    return _reduced(picture)


def draw_surfaces(solid: Solid, surfaces: Surfaces, camera: Camera, reach: float) -> Picture:
    """The same of surfaces: one ray per pixel, and four where neighbours show something else."""
    depth, normals, labels = surfaces.seen_from(camera)
    rows, columns = np.nonzero(_varied(depth, normals, labels, camera))
    ends = (np.arange(_SUPERSAMPLING) + 0.5) / _SUPERSAMPLING - 0.5
    v, u = (one.ravel().astype(np.float32) for one in np.meshgrid(ends, ends, indexing="ij"))
    below, right = ((x[:, None] + y).ravel() for x, y in ((rows, v), (columns, u)))
    finer = surfaces.met(camera, right.astype(np.float32), below.astype(np.float32))

    every_row, every_column = np.indices(depth.shape, dtype=np.float32)
    places = directions(
        camera,
        np.concatenate([every_column.ravel(), right]).astype(np.float32),
        np.concatenate([every_row.ravel(), below]).astype(np.float32),
    )
    flat = [depth.ravel(), normals.reshape(-1, 3), labels.ravel()]
    far, facing, owners = (np.concatenate(pair) for pair in zip(flat, finer, strict=True))
    points = (camera.T_world_camera[:3, 3] + far[:, None] * places).astype(np.float32)
    colours = _coloured(solid, far, facing, owners.astype(np.int64), points, camera, reach)

    count = depth.size
    picture = colours[:count].reshape(*depth.shape, 3)
    n = _SUPERSAMPLING
    blocks = [np.repeat(np.repeat(one, n, axis=0), n, axis=1) for one in (labels, depth)]
    around = (n * rows[:, None] + np.repeat(np.arange(n), n)).ravel()
    across = (n * columns[:, None] + np.tile(np.arange(n), n)).ravel()
    blocks[0][around, across], blocks[1][around, across] = finer[2], finer[0]
    edge = _outline(blocks[0].astype(np.int64), blocks[1].astype(np.float32))[around, across]
    parts = colours[count:] * np.where(edge, np.float32(_OUTLINE), 1)[:, None]
    picture[rows, columns] = parts.reshape(len(rows), n * n, 3).mean(axis=1)
    return picture


def _coloured(
    solid: Solid,
    depth: Float32,
    normals: Float32,
    labels: NDArray[np.int64],
    points: Float32,
    camera: Camera,
    reach: float,
) -> Float32:
    """Colours (N, 3) of what rays (N,) meet; white where they meet nothing."""
    is_floor = (depth > 0) & (labels == 0)
    hit = (depth > 0) & ~(is_floor & (np.hypot(points[:, 0], points[:, 1]) > reach))
    found = np.ones((len(depth), 3), dtype=np.float32)
    points, labels, is_floor = points[hit], labels[hit], is_floor[hit]
    light = _light(solid, points, normals[hit], is_floor, camera)
    colour = _base_colours(solid, labels, points, is_floor)
    if solid.seen is not None:
        own = ~is_floor
        share = _seen_share(solid.seen, solid.grid, points[own])
        colour[own] = _PALE + (colour[own] - _PALE) * share
    found[hit] = _faded(np.clip(colour * light, 0, 1), points, is_floor, reach)
    return found


def _varied(depth: Float32, normals: Float32, labels: Int32, camera: Camera) -> NDArray[np.bool_]:
    """Pixels (H, W) beside which something else is seen, or a line of the floor."""
    varied = np.zeros(depth.shape, dtype=bool)
    for axis in (0, 1):
        first, second = (
            tuple(one if a == axis else slice(None) for a in (0, 1))
            for one in (slice(None, -1), slice(1, None))
        )
        other = labels[first] != labels[second]
        other |= (depth[first] > 0) != (depth[second] > 0)
        other |= np.einsum("hwk,hwk->hw", normals[first], normals[second]) < _ALIKE_NORMAL
        jump = np.abs(depth[first] - depth[second]) > _JUMP
        other |= jump & (labels[first] > 0) & (labels[second] > 0)
        varied[first] |= other
        varied[second] |= other
    points = _points(depth, camera)
    near = np.abs((points[..., :2] + _GRID_LINES) % (2 * _GRID_LINES) - _GRID_LINES).min(axis=-1)
    # A pixel of the floor is longer away from the camera, by the slope of the ray
    slope = camera.T_world_camera[2, 3] / np.maximum(depth, 1e-6)
    pixel = depth / camera.fx / np.clip(slope, 0.1, 1)
    return varied | ((labels == 0) & (depth > 0) & (near < _LINE + pixel))


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
    on_lines = np.flatnonzero(is_floor)[np.minimum(x, y) < _LINE]
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
    share = np.clip(2 * sample(seen, grid, points) - 0.5, 0, 1)[:, None]
    return (_HIDDEN + (1 - _HIDDEN) * share).astype(np.float32)


def _light(
    solid: Solid,
    points: Float32,
    normals: Float32,
    is_floor: NDArray[np.bool_],
    camera: Camera,
) -> Float32:
    """Brightness (N, 1) of points on objects and floor."""
    right, down, forward = camera.T_world_camera[:3, :3].T
    key = -0.55 * right - 0.5 * down - 0.35 * forward + np.array([0.0, 0.0, 0.9])
    key = (key / np.linalg.norm(key)).astype(np.float32)
    grid, brightness = solid.grid, np.empty(len(points), dtype=np.float32)
    of_floor, of_objects = solid.far
    brightness[is_floor] = floor_brightness(of_floor, grid, points[is_floor], key)
    objects = ~is_floor
    brightness[objects] = brightness_of(of_objects, grid, points[objects], normals[objects], key)
    return brightness[:, None]


def _faded(colour: Float32, points: Float32, is_floor: NDArray[np.bool_], reach: float) -> Float32:
    """Colours (N, 3) of which the floor's become white far from the middle."""
    radius = np.hypot(points[:, 0], points[:, 1]) / reach
    fade = np.where(is_floor, np.clip((radius - 0.45) / 0.55, 0, 1) ** 1.5, 0.0)[:, None]
    return (colour * (1 - fade) + fade).astype(np.float32)


def _outline(labels: NDArray[np.int64], depth: Float32) -> NDArray[np.bool_]:
    """Rays (H, W) after which the object changes, or where depth jumps within it."""
    edge = np.zeros(labels.shape, dtype=bool)
    for axis in (0, 1):
        change = np.diff(labels, axis=axis) != 0
        step = (np.abs(np.diff(depth, axis=axis)) > _JUMP) & (np.delete(labels, 0, axis) > 0)
        pad = [(0, 1) if a == axis else (0, 0) for a in (0, 1)]
        edge |= np.pad(change | step, pad)
    return edge


def _reduced(picture: Float32) -> Float32:
    """Mean of each block of rays."""
    n = _SUPERSAMPLING
    parts = [picture[i::n, j::n] for i in range(n) for j in range(n)]
    return sum(parts[1:], start=parts[0]) / np.float32(n * n)
