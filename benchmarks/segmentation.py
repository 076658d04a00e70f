"""Labels of one view and of one height map, from colour and distance to probabilities.

The network is that of `model=fusenet`, its weights random: they don't change the time. The peer of
the sliding window is the same network in one pass over everything.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch

from benchmarks.harness import Job, Timed
from scenefw.core.height_maps import HeightGrid, HeightMap
from scenefw.core.types import Camera, Frame
from scenefw.labelling.sliding_window import SlidingWindow
from scenefw.labelling.sources import NetworkLabels, NetworkMapLabels
from scenefw.models.fusenet import FuseNet

CLASSES = ("surface", "remote_control", "keyboard", "model_plane")


@dataclass
class Untrained:
    """A checkpoint's stand-in."""

    model: Any = field(
        default_factory=lambda: FuseNet(len(CLASSES), (16, 24, 48, 80), (1, 2, 2, 3))
    )
    metadata: Any = field(default_factory=lambda: {"classes": CLASSES})
    recipe: Any = field(default_factory=dict)


def colour(*size: int) -> np.ndarray:
    """Noise, the hardest picture to compress but as quick to label as any."""
    return np.random.default_rng(0).integers(0, 256, (*size, 3), np.uint8)


def view() -> Timed:
    """320 x 240."""
    camera = Camera().resized(320, 240)
    frame = Frame(np.full((240, 320), 0.3, np.float32), camera, colour(240, 320))
    source = NetworkLabels(Untrained())
    return lambda: source.label(frame)


def height_map(window: SlidingWindow) -> Timed:
    """1025 x 1025."""
    grid = HeightGrid()
    flat = np.zeros(grid.shape, np.float32)
    known = HeightMap(grid, flat, colour(*grid.shape), flat, flat)
    source = NetworkMapLabels(Untrained(), window)
    return lambda: source.label_map(known)


def pass_over_all() -> Timed:
    """One window as large as the map."""
    return height_map(SlidingWindow(window=2048))


JOBS = [
    Job(f"labels of one view, 320 x 240, {torch.get_num_threads()} threads", view),
    Job(
        "labels of one map, 1025 x 1025, windows of 512 MB",
        lambda: height_map(SlidingWindow(memory=512)),
        {"one pass": pass_over_all},
        repeats=5,
    ),
]
