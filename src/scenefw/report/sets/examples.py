"""Pictures of test scenes: the view, the truth and what methods make of it."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage

from scenefw.core.types import Camera, Float32, GridSpec
from scenefw.evaluation.sets.results import DecompositionResult, SetExample
from scenefw.matching.instances import renumbered_like
from scenefw.report.blocks import Picture
from scenefw.report.palette import instance_colours
from scenefw.report.pictures import beside, depth_picture, save_picture
from scenefw.report.sets.names import called
from scenefw.report.shading import Solid, draw, turned

_SIZE = (320, 240)  # of a tile: width, height (pixels)
_SMOOTHED = 0.7  # voxels: labels are steps, surfaces aren't
_ACROSS = 5  # tiles beside each other at most
_TURN = 160.0  # degrees: what the camera doesn't see


def example_pictures(result: DecompositionResult, folder: Path) -> tuple[Picture, ...]:
    """One picture per example, written into the folder.

    Raises:
        StorageError: the folder can't be written.
    """
    pictures = []
    for example in result.examples:
        name = f"sets/{result.published or 'scenes'}_{example.scene}.jpg"
        save_picture(draw_example(example), folder / name)
        counts = {key: len(np.unique(labels[labels > 0])) for key, labels in example.labels.items()}
        words = ", ".join(f"{called(key)} {count}" for key, count in counts.items())
        pictures.append(Picture(name, f"Scene {example.scene}; objects: {words}"))
    return tuple(pictures)


def draw_example(example: SetExample) -> Float32:
    """RGB (H, W, 3): depth, truth and methods from the camera, and below from behind.

    More than five tiles from one side take several rows.

    A predicted object has the colour of the true one that it is matched to. Methods that found
    nothing are left out, but for the first.
    """
    truth = example.labels["truth"].astype(np.int32)
    lens = example.camera.resized(*_SIZE)
    points = example.grid.centres()[truth > 0]
    depth = Image.fromarray(np.rint(depth_picture(example.depth) * 255).astype(np.uint8))
    first = np.asarray(depth.resize(_SIZE), dtype=np.float32) / np.float32(255)
    names = [
        name for i, (name, labels) in enumerate(example.labels.items()) if i < 2 or labels.any()
    ]
    columns = -(-(len(names) + 1) // (1 + len(names) // _ACROSS))
    padding = -(len(names) + 1) % columns
    tiles, titles = [], []
    for turn, corner, word in ((0.0, first, "depth"), (_TURN, np.ones_like(first), "from behind")):
        camera = turned(lens, points, turn)
        tiles.append(corner)
        titles.append(word)
        for name in names:
            labels = renumbered_like(example.labels[name].astype(np.int32), truth)
            tiles.append(_draw_labels(labels, example.grid, camera))
            titles.append(called(name))
        tiles += [np.ones_like(first)] * padding
        titles += [""] * padding
    return beside(tiles, titles, columns)


def _draw_labels(labels: NDArray[np.int32], grid: GridSpec, camera: Camera) -> Float32:
    solid = Solid(distances(labels > 0, grid), labels, grid, instance_colours(int(labels.max())))
    return draw(solid, camera)


def distances(inside: NDArray[np.bool_], grid: GridSpec) -> Float32:
    """Signed distance (X, Y, Z) to the border of voxels (m), smoothed, cut at the truncation."""
    if not inside.any():
        return np.full(inside.shape, grid.truncation, np.float32)
    out = ndimage.distance_transform_edt(~inside) - ndimage.distance_transform_edt(inside)
    voxels = ndimage.gaussian_filter(out - 0.5 * np.sign(out), _SMOOTHED)
    tsdf = np.clip(voxels * grid.voxel_size, -grid.truncation, grid.truncation)
    return tsdf.astype(np.float32)
