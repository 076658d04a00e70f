"""Films of simulated grasps: pictures by ray casting, and moving pictures as GIF."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from PIL import Image

from scenefw.core.files import replacing
from scenefw.core.geometry import transform_points
from scenefw.core.types import Camera, Float32, Float64
from scenefw.kernels.meshes import TABLE, Tree
from scenefw.report.palette import Colour, instance_colours
from scenefw.report.pictures import Picture, beside
from scenefw.report.shading import turned
from scenefw_grasping.grasps import Film

_SIZE = (330, 270)  # width, height of a panel (pixels)
_FINE = 2  # rays per pixel and direction
_ROBOT: Colour = (0.80, 0.81, 0.84)
_FLOOR: Colour = (0.90, 0.90, 0.91)
_REACH = 0.65  # m: the floor fades out
_SKIN = 2e-3  # m
_SLOWED = 1.6  # times slower than real, to be followed
_LAST = 1.2  # s that the last picture stays
_COLOURS = 160
_TURNS = (0.0, 60.0, -60.0, 120.0, -120.0)  # degrees, views to choose from
_ENOUGH = 0.7  # of the objects' pixels in the best view
_COARSE = 6  # pixels between the rays that compare views


def film_picture(film: Film, number: int, camera: Camera) -> Picture:
    """RGB (H, W, 3) in [0, 1] of one picture of a film, on a floor that fades into white.

    Args:
        film: parts that move.
        number: of the picture.
        camera: from where.
    """
    corners, colours = _triangles(film, number)
    fine = camera.resized(camera.width * _FINE, camera.height * _FINE)
    tree = Tree(corners)
    directions = _directions(fine)
    eye = fine.T_world_camera[:3, 3]
    rays = np.concatenate([np.broadcast_to(eye, directions.shape), directions], axis=1)
    distance, hit = (x.numpy() for x in tree.cast(torch.from_numpy(np.float32(rays)))[:2])
    points = eye + distance[:, None] * directions
    normals, colour = _surface(tree, hit, colours, directions)
    light = _light(fine)
    lit = np.clip(normals @ light, 0, 1) * ~_blocked(tree, points + _SKIN * normals, light)
    shade = 0.60 + 0.12 * normals[:, 2] + 0.30 * lit
    picture = np.clip(colour * shade[:, None], 0, 1)
    far = np.linalg.norm(points[:, :2], axis=1) / _REACH
    fade = np.where(hit == TABLE, np.clip((far - 0.5) / 0.5, 0, 1), np.where(hit < 0, 1.0, 0.0))
    picture += (1 - picture) * fade[:, None]
    rows = picture.reshape(camera.height, _FINE, camera.width, _FINE, 3)
    return np.asarray(rows.mean(axis=(1, 3)), dtype=np.float32)


def film_camera(films: Sequence[Film], camera: Camera) -> Camera:
    """A camera that has all objects of films in its picture, and sees most of them past the arm.

    It looks from the side of another one, unless the arm hides much of the objects from there.
    """
    points = [
        transform_points(film.poses[i, part], film.meshes[part].vertices)
        for film in films
        for part, label in enumerate(film.labels)
        if label
        for i in (0, -1)
    ]
    inside = np.concatenate([np.zeros((0, 3)), *points])
    inside = inside[(np.abs(inside) < 0.6).all(axis=1)]  # what rolled away need not be seen
    views = [turned(camera.resized(*_SIZE), inside, turn) for turn in _TURNS]
    coverage = [sum(_objects_seen(film, view) for film in films) for view in views]
    return views[0] if coverage[0] > _ENOUGH * max(coverage) else views[int(np.argmax(coverage))]


def _objects_seen(film: Film, camera: Camera) -> float:
    """Share of the pictures, at their start, middle and end, that objects cover."""
    coarse_camera = camera.resized(camera.width // _COARSE, camera.height // _COARSE)
    directions = _directions(coarse_camera)
    eye = np.broadcast_to(coarse_camera.T_world_camera[:3, 3], directions.shape)
    rays = torch.from_numpy(np.concatenate([eye, directions], axis=1).astype(np.float32))
    parts = np.repeat(film.labels, [len(mesh.faces) for mesh in film.meshes])
    shares = []
    for number in (0, len(film.poses) // 2, len(film.poses) - 1):
        tree = Tree(_triangles(film, number)[0])
        hit = tree.cast(rays)[1].numpy()
        shares.append((parts[tree.order][hit[hit >= 0]] > 0).sum() / len(hit))
    return float(np.mean(shares))


def film_pictures(films: Sequence[Film], titles: Sequence[str], camera: Camera) -> list[Picture]:
    """Pictures of several films side by side; one that ends first stays at its end."""
    view = film_camera(films, camera)
    sequences = [[film_picture(f, i, view) for i in range(len(f.poses))] for f in films]
    length = max(len(pictures) for pictures in sequences)
    return [
        beside([p[min(i, len(p) - 1)] for p in sequences], list(titles), columns=len(sequences))
        for i in range(length)
    ]


def save_film(path: Path, pictures: Sequence[Picture], seconds: float) -> None:
    """Writes pictures as a GIF that repeats, slower than real.

    Args:
        path: the file, replaced as a whole.
        pictures: RGB (H, W, 3) in [0, 1].
        seconds: from one to the next in the simulation.

    Raises:
        StorageError: the file can't be written.
    """
    images = [Image.fromarray(np.rint(np.clip(p, 0, 1) * 255).astype(np.uint8)) for p in pictures]
    common = images[len(images) // 2].quantize(_COLOURS)
    paletted = [image.quantize(palette=common, dither=Image.Dither.NONE) for image in images]
    frame_duration = round(1000 * seconds * _SLOWED)
    durations = [frame_duration] * (len(images) - 1) + [round(1000 * _LAST)]
    with replacing(path) as temporary:
        paletted[0].save(
            temporary, save_all=True, append_images=paletted[1:], duration=durations, loop=0
        )


def _triangles(film: Film, number: int) -> tuple[Float32, Float32]:
    """Corners (F, 3, 3) in the world and colours (F, 3) of all parts."""
    table = instance_colours(max([*film.labels, 1]))
    corners, colours = [np.zeros((0, 3, 3))], [np.zeros((0, 3))]
    for mesh, label, pose in zip(film.meshes, film.labels, film.poses[number], strict=True):
        placed = transform_points(pose, mesh.vertices)
        corners.append(placed[mesh.faces])
        colours.append(np.tile(table[label - 1] if label else _ROBOT, (len(mesh.faces), 1)))
    return (
        np.concatenate(corners).astype(np.float32),
        np.concatenate(colours).astype(np.float32),
    )


def _directions(camera: Camera) -> Float64:
    """Unit vectors (H * W, 3) through the pixels."""
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    local = np.stack(
        [(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], axis=-1
    ).reshape(-1, 3)
    local /= np.linalg.norm(local, axis=1, keepdims=True)
    return np.asarray(local @ camera.T_world_camera[:3, :3].T)


def _surface(
    tree: Tree, hit: np.ndarray, colours: Float32, directions: Float64
) -> tuple[Float64, Float64]:
    """Normals towards the camera and colours (R, 3) of what rays hit."""
    normals = np.tile([0.0, 0.0, 1.0], (len(hit), 1))
    colour = np.tile(_FLOOR, (len(hit), 1))
    on = hit >= 0
    sides = tree.triangles.numpy()[hit[on], 3:].astype(np.float64)
    across = np.cross(sides[:, :3], sides[:, 3:])
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    across *= -np.sign((across * directions[on]).sum(axis=1, keepdims=True))
    normals[on], colour[on] = across, colours[tree.order][hit[on]]
    return normals, colour


def _light(camera: Camera) -> Float64:
    """Direction to the light, over the camera's left shoulder."""
    right, down, forward = camera.T_world_camera[:3, :3].T
    light = -0.5 * right - 0.4 * down - 0.35 * forward + np.array([0.0, 0.0, 1.0])
    return np.asarray(light / np.linalg.norm(light))


def _blocked(tree: Tree, points: Float64, light: Float64) -> np.ndarray:
    rays = np.concatenate([points, np.broadcast_to(light, points.shape)], axis=1)
    return np.asarray(tree.cast(torch.from_numpy(np.float32(rays)), table=False)[1].numpy() >= 0)
