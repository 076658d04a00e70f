"""Height and label fusion on the CUDA grid, in numba's simulator, equal the CPU's loops."""

import numpy as np
import pytest
from tests.unit.mapping import tables

from scenefw.core.height_maps import HeightGrid
from scenefw.core.types import Frame
from scenefw.mapping.height_fusion import HeightFusion
from scenefw.mapping.semantic_fusion import SemanticFusion
from scenefw_labelling_studies.image_space_fusion import ImageSpaceFusion
from scenefw_painting.height_map import view

GRID = HeightGrid(vertices=17, extent=0.128, lower=(-0.064, -0.064), levels=2)


def results():
    """Everything that fusion computes, by name."""
    cameras = [tables.camera(0, 0, 0.2, 20, k, width=14, rows=10) for k in range(2)]
    frames = [tables.boxes(camera) for camera in cameras]
    rng = np.random.default_rng(0)
    said = np.moveaxis(rng.dirichlet(np.ones(3), (10, 14)), -1, 0).astype(np.float32)
    running = HeightFusion(GRID, iterations=1).begin()
    for frame in frames:
        running.add(frame)
    known = running.height_map()
    bad = Frame(frames[0].depth * np.float32(0.8), cameras[0])
    outvoted = HeightFusion(GRID, iterations=1).begin()
    for frame in (bad, *frames, *frames):
        outvoted.add(frame)
    labels = SemanticFusion(angle_power=1.0).begin(GRID, 3)
    in_images = ImageSpaceFusion(angle_power=1.0).begin(GRID, 3)
    for frame in frames:
        labels.add(said, frame)
        in_images.add(said, frame, known)
    return {
        "heights": np.nan_to_num(known.heights),
        "confidence": known.confidence,
        "heights after a bad frame": np.nan_to_num(outvoted.height_map().heights),
        "rivals": outvoted.state()["rivals"],
        "labels": labels.probabilities(),
        "labels in images": in_images.probabilities(),
        "view": view(known, cameras[0]).depth,
    }


@pytest.fixture(scope="module")
def expected():
    return results()


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        ("heights", 1e-5),
        ("confidence", 1e-4),
        ("heights after a bad frame", 1e-5),
        ("rivals", 1e-4),
        ("labels", 1e-4),
        ("labels in images", 1e-4),
        ("view", 1e-4),
    ],
)
def test_the_grid_of_threads_gives_what_the_loop_gives(simulated, expected, name, tolerance):
    wanted, got = expected[name], simulated[name]
    assert got.shape == wanted.shape
    assert len(np.unique(wanted)) > 10
    far = np.abs(got.astype(np.float64) - wanted) > tolerance
    assert far.mean() <= 0.02  # rounding may put a pixel on the other side of a border
