"""Numbers of scenes of superquadrics, the same wherever they stand and however they are turned."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from scenefw.shapes.superquadric import Superquadric

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from scenefw.core.batches import SceneParameters
    from scenefw.core.types import SceneObject

    Array = NDArray[np.float64]
    Objects = Sequence[SceneObject]

_SAMPLES = 16  # points along each side of the box that two objects share
_CM3 = 1e6  # in a cubic metre
_FIRM = 1e-9


def quantities(scene: Objects) -> dict[str, Array]:
    """Values of a scene whose distributions are compared.

    `count` (1,), `volume` (N,) of objects (m^3), `height` (N,) of centres (m), `distance` (P,) of
    pairs of centres (m), `penetration` (1,) that pairs share (m^3), `sunk` (1,) how far the lowest
    point lies below the floor (m).
    """
    centres = np.array([item.pose.position for item in scene]).reshape(-1, 3)
    pairs = list(combinations(range(len(scene)), 2))
    gaps = np.array([np.linalg.norm(centres[i] - centres[j]) for i, j in pairs])
    shared = sum(shared_volume(scene[i], scene[j]) for i, j in pairs)
    return {
        "count": np.array([float(len(scene))]),
        "volume": np.array([item.shape.volume() for item in scene]),
        "height": centres[:, 2],
        "distance": gaps,
        "penetration": np.array([float(shared)]),
        "sunk": np.array([max([0.0, *(-_lowest(item) for item in scene)])]),
    }


def descriptor(scene: Objects, scene_values: Mapping[str, Array] | None = None) -> Array:
    """Twelve numbers (12,) of a scene; 0 where it has too few objects.

    Number of objects; mean and deviation of logarithms of volumes; means of logarithms of longest
    by shortest axis and of exponents; mean and largest height, mean and least distance of centres;
    logarithm of the shared volume; how far it reaches below the floor; how far its highest object
    lies above the next one.

    Args:
        scene: its objects.
        scene_values: its `quantities`.
    """
    if not scene:
        return np.zeros(12)
    values = quantities(scene) if scene_values is None else scene_values
    volumes = np.log(np.maximum(values["volume"], _FIRM))
    shapes = [item.shape for item in scene if isinstance(item.shape, Superquadric)]
    ratios = [np.log(shape.half_axes.max() / shape.half_axes.min()) for shape in shapes]
    exponents = [np.log(shape.exponents).mean() for shape in shapes]
    heights = np.sort(values["height"])
    distances = values["distance"] if len(values["distance"]) else np.zeros(1)
    top = heights[-1] - heights[-2] if len(heights) > 1 else 0.0
    return np.array(
        [
            len(scene), volumes.mean(), volumes.std(), np.mean(ratios or [0.0]),
            np.mean(exponents or [0.0]), heights.mean(), heights[-1], distances.mean(),
            distances.min(), np.log1p(_CM3 * values["penetration"][0]), values["sunk"][0], top,
        ]
    )  # fmt: skip


def shared_volume(first: SceneObject, second: SceneObject) -> float:
    """What two superquadrics both fill (m^3), by points of a lattice."""
    a, b = first.shape, second.shape
    if not (isinstance(a, Superquadric) and isinstance(b, Superquadric)):
        return 0.0
    boxes = [_box(item, shape) for item, shape in ((first, a), (second, b))]
    low = np.maximum(boxes[0][0], boxes[1][0])
    high = np.minimum(boxes[0][1], boxes[1][1])
    if (low >= high).any():
        return 0.0
    steps = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    axes = [start + steps * (end - start) for start, end in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    inside = np.ones(len(points), dtype=bool)
    for item, shape in ((first, a), (second, b)):
        inside &= shape.value((points - item.pose.position) @ item.pose.rotation) < 1
    return float(inside.mean() * (high - low).prod())


def object_numbers(scenes: SceneParameters) -> tuple[Array, NDArray[np.int64]]:
    """Numbers (S, N, 5) of the objects of scenes, largest first, and how many (S,) each has.

    Of an object: logarithms of its half-axes, longest first, the height of its centre (m) and how
    far that lies from the scene's middle (m). Absent objects come last, with zeros.
    """
    present = scenes.present.cpu().numpy()
    axes = scenes.half_axes.double().cpu().numpy()
    positions = scenes.positions.double().cpu().numpy()
    counts = present.sum(axis=1)
    logs = np.sort(np.log(np.maximum(axes, _FIRM)), axis=-1)[..., ::-1]
    share = present[..., None] / np.maximum(counts, 1)[:, None, None]
    middle = (positions[..., :2] * share).sum(axis=1, keepdims=True)
    radii = np.linalg.norm(positions[..., :2] - middle, axis=-1)
    numbers = np.concatenate([logs, positions[..., 2:], radii[..., None]], axis=-1)
    order = np.argsort(np.where(present, -logs.sum(axis=-1), np.inf), axis=1, kind="stable")
    numbers = np.take_along_axis(np.where(present[..., None], numbers, 0.0), order[..., None], 1)
    return numbers, counts


def nearest_scene(
    scenes: tuple[Array, NDArray[np.int64]], references: tuple[Array, NDArray[np.int64]]
) -> Array:
    """Distance (S,) of scenes to the nearest known one of as many objects; NaN where none has.

    Root mean square over objects, in order of their size, and over their numbers, in units of the
    deviation of the known ones.

    Args:
        scenes: of `object_numbers`.
        references: the same of others.
    """
    rows = references[0][np.arange(references[0].shape[1]) < references[1][:, None]]
    unit = np.maximum(rows.std(axis=0), _FIRM) if len(rows) else np.ones(scenes[0].shape[-1])
    distances = np.full(len(scenes[0]), np.nan)
    for i, (numbers, count) in enumerate(zip(*scenes, strict=True)):
        candidates = references[0][references[1] == count, :count]
        if count and len(candidates):
            squares = (((candidates - numbers[:count]) / unit) ** 2).mean(axis=(1, 2))
            distances[i] = np.sqrt(squares.min())
    return distances


def _box(item: SceneObject, shape: Superquadric) -> tuple[Array, Array]:
    reach = np.abs(item.pose.rotation) @ shape.half_axes
    return item.pose.position - reach, item.pose.position + reach


def _lowest(item: SceneObject) -> float:
    """Height of its lowest point (m)."""
    if not isinstance(item.shape, Superquadric):
        return float(item.pose.position[2])
    down = -item.pose.rotation[2]  # in the object's frame
    return float(item.pose.position[2] - item.shape.support(down) @ down)
