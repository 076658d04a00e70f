"""What a data set of scenes looks like: numbers and a figure."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenefw.core.files import replacing
from scenefw.core.geometry import rotation_from_quaternion
from scenefw.scenes.splits import SPLITS
from scenefw.scenes.storage import Stored, StoredScenes
from scenefw.shapes.superquadric import support_points

Array = NDArray[np.float64]


def summary(stored: Stored) -> dict[str, float]:
    """Flat figures: scenes, objects; of superquadrics mean extent and height of a scene (m)."""
    figures = {"scenes": float(len(stored)), "objects": float(stored.count.sum())}
    figures |= {f"scenes_{name}": float((stored.split == i).sum()) for i, name in enumerate(SPLITS)}
    if len(stored) and isinstance(stored, StoredScenes):
        figures["mean_extent"] = float(2 * stored.half_axes[present(stored)].mean())
        figures["mean_height"] = float(heights(stored).mean())
    return figures


def present(stored: StoredScenes) -> NDArray[np.bool_]:
    """(S, N): which rows are objects."""
    return np.arange(stored.masses.shape[1]) < stored.count[:, None]


def heights(stored: StoredScenes) -> Array:
    """(S,) highest point of each scene over the floor (m)."""
    rotations = rotation_from_quaternion(stored.quaternions)
    upward = rotations[..., 2, :]  # world z in the frame of each object
    tips = support_points(stored.half_axes, stored.exponents, upward)
    tops = stored.positions[..., 2] + np.einsum("sni,sni->sn", upward, tips)
    return np.where(present(stored), tops, 0).max(axis=1)


def draw(stored: StoredScenes, path: Path) -> None:
    """Writes a figure: objects per scene, split, extents, exponents, heights, places."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    present_mask = present(stored)
    figure = Figure(figsize=(10, 5.6), layout="constrained")
    axes = figure.subplots(2, 3).ravel()
    counts, times = np.unique(stored.count, return_counts=True)
    axes[0].bar(counts.astype(str), times)
    axes[0].set(xlabel="objects per scene", ylabel="scenes")
    axes[1].bar(SPLITS, [(stored.split == i).sum() for i in range(len(SPLITS))])
    axes[1].set(xlabel="part", ylabel="scenes")
    axes[2].hist(200 * stored.half_axes[present_mask].ravel(), bins=40)
    axes[2].set(xlabel="extent (cm)", ylabel="object axes")
    axes[3].hist(np.log10(stored.exponents[present_mask].ravel()), bins=40)
    ticks = [2, 5, 10, 20, 50, 100]
    axes[3].set(xlabel="exponent", ylabel="object axes", xticks=np.log10(ticks), xticklabels=ticks)
    axes[4].hist(100 * heights(stored), bins=40)
    axes[4].set(xlabel="height of the scene (cm)", ylabel="scenes")
    centres = 100 * stored.positions[present_mask]
    axes[5].plot(centres[:, 0], centres[:, 1], ",", alpha=0.5)
    axes[5].set(xlabel="object centre x (cm)", ylabel="y (cm)", aspect="equal")
    for index, axis in enumerate(axes):
        axis.spines[["top", "right"]].set_visible(False)
        axis.set_title("abcdef"[index], loc="left", fontsize=9)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    picture = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    with replacing(path) as temporary:
        picture.quantize(64).save(temporary, optimize=True)
