"""Mitsuba's views against the ray caster's: same depth and labels, much the same colour."""

import dataclasses

import numpy as np
import pytest

from scenefw.core.errors import ConfigError
from scenefw.core.geometry import look_at
from scenefw.core.height_maps import HeightGrid
from scenefw.core.tabletop import NOISE
from scenefw.core.types import Camera
from scenefw.renderers.mesh_raycaster import MeshRaycaster
from scenefw_annotated_views.baking import refined
from scenefw_annotated_views.physically_based import PhysicallyBased
from scenefw_tabletops.scenes.tabletop import TabletopGenerator
from scenefw_tabletops.shapes.tabletop.library import ProceduralModels

GENERATOR = TabletopGenerator(ProceduralModels())
SCENE = dataclasses.replace(
    GENERATOR.generate(0, 0),
    surface=(0.8, 0.1, 0.1, NOISE, 0.06, 1.0, 0.4, 0.1, 0.1, 0.8, 0.0),
)
GEOMETRY = GENERATOR.geometry(SCENE)
# Off centre, so that a mirrored principal point would show.
CENTRED = Camera(T_world_camera=look_at((0.1, -0.25, 0.38), (0.05, 0.0, 0.0))).resized(64, 48)
CAMERA = dataclasses.replace(CENTRED, cx=CENTRED.cx + 9, cy=CENTRED.cy - 6)


@pytest.fixture(scope="module")
def renderer():
    pytest.importorskip("mitsuba")
    return PhysicallyBased(samples=8, bounces=2, detail=0.01)


def alike(first, second):
    """Correlation of two images, each channel about its mean."""
    first, second = (image.reshape(-1, 3) - image.mean(axis=(0, 1)) for image in (first, second))
    return np.corrcoef(first.ravel(), second.ravel())[0, 1]


@pytest.mark.exhaustive
def test_a_view_equals_the_ray_casters(renderer):
    ours = next(MeshRaycaster().frames(GEOMETRY, [CAMERA]))
    theirs = next(renderer.frames(GEOMETRY, [CAMERA]))
    assert (np.abs(theirs.depth - ours.depth) < 1e-4).mean() > 0.995
    assert (theirs.labels == ours.labels).mean() > 0.995
    assert alike(theirs.colour, ours.colour) > 0.85
    table = (ours.labels == 0)[..., None]
    assert alike(theirs.colour * table, ours.colour * table) > 0.85
    assert theirs.colour.mean() == pytest.approx(ours.colour.mean(), rel=0.2)


@pytest.mark.exhaustive
def test_a_map_equals_the_ray_casters(renderer):
    grid = HeightGrid(vertices=65)
    ours, theirs = (r.height_map(GEOMETRY, grid) for r in (MeshRaycaster(), renderer))
    assert (np.abs(theirs.heights - ours.heights) < 1e-4).mean() > 0.99
    assert (theirs.labels == ours.labels).mean() > 0.99
    assert alike(theirs.colour, ours.colour) > 0.7


@pytest.mark.exhaustive
def test_an_empty_table_and_beyond(renderer):
    empty = GENERATOR.geometry(dataclasses.replace(SCENE, items=()))
    level = CAMERA.moved(look_at((0, 0, 0.3), (1.0, 0, 0.3)))
    frame = next(renderer.frames(empty, [level]))
    assert (frame.labels[:15] == -1).all()
    assert (frame.depth[:15] == 0).all()
    assert (frame.labels[-5:] == 0).all()


def test_refined_triangles_cover_the_old_ones():
    finer, parent = refined(GEOMETRY, 0.01)

    def areas(corners):
        a, b, c = np.moveaxis(corners.astype(np.float64), 1, 0)
        return np.linalg.norm(np.cross(b - a, c - a), axis=-1)

    held = np.bincount(parent, areas(finer.corners), minlength=len(GEOMETRY.corners))
    assert np.allclose(held, areas(GEOMETRY.corners), rtol=1e-3, atol=1e-9)
    assert np.array_equal(finer.item_of, GEOMETRY.item_of[parent])


def test_settings():
    with pytest.raises(ConfigError, match="samples = 0"):
        PhysicallyBased(samples=0)
