"""Folders of stored images made by hand."""

import numpy as np

from scenefw_things.images.stored_images import DEPTH_UNIT, OBSTACLE, StoredImages


def write(folder, count, size, seed=0):
    """Images of a floor 0.8 m below the camera, with a box of colour and one of an obstacle."""
    rng = np.random.default_rng(seed)
    images = StoredImages.create(folder, count, size, {"seed": seed})
    width, height = size
    box = np.s_[:, height // 5 : 2 * height // 5, width // 12 : 2 * width // 5]
    obstacle = np.s_[:, 3 * height // 5 : 4 * height // 5, 3 * width // 5 : 9 * width // 10]
    images.depth[:] = round(0.8 / DEPTH_UNIT)
    images.depth[box] = round(0.7 / DEPTH_UNIT)
    images.owners[box] = 3
    images.owners[obstacle] = OBSTACLE + 1
    images.colour[:] = rng.integers(0, 256, images.colour.shape)
    images.intrinsics[:] = (1.1 * width, 1.1 * width, width / 2 - 2, height / 2)
    images.poses[:] = np.diag([1, -1, -1, 1])
    images.poses[:, :3, 3] = (0.1, 0.2, 0.8)
    images.facts["images"] = count
    images.save()
    return images


def write_images(folder, size=(320, 240)):
    """Training and validation images; returns the folder."""
    for name, count in (("train", 6), ("val", 3)):
        write(folder / name, count, size)
    return folder
