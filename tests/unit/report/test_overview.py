import numpy as np
import pytest
import trimesh
from PIL import Image

from scenefw.core.geometry import look_at
from scenefw.core.types import (
    Camera,
    Frame,
    GridSpec,
    ObjectEstimate,
    Pose,
    SceneEstimate,
    TriangleMesh,
)
from scenefw.report.overview import write_overview
from scenefw.report.pictures import font_of
from scenefw.report.solids import solid_of
from scenefw.report.window import two_views


def estimate_of(resolution=32, objects=1, colour=True):
    grid = GridSpec(resolution=resolution)
    camera = Camera(160, 120, 180.0, 180.0, 79.5, 59.5, look_at((0, -0.9, 0.6), (0, 0, 0.1)))
    distance = np.linalg.norm(grid.centres() - (0, 0, 0.12), axis=-1) - 0.12
    tsdf = np.clip(distance, -grid.truncation, grid.truncation).astype(np.float32)
    ball = trimesh.creation.icosphere(radius=0.12)
    mesh = TriangleMesh(ball.vertices + np.array((0, 0, 0.12)), np.array(ball.faces))
    pose = Pose(np.array((0, 0, 0.12)), np.array([1.0, 0, 0, 0]))
    items = tuple(ObjectEstimate(i + 1, mesh, pose, np.full(3, 0.24), 0.9) for i in range(objects))
    depth = np.full((120, 160), 0.9, dtype=np.float32)
    depth[:5] = 0
    picture = np.full((120, 160, 3), 90, dtype=np.uint8) if colour else None
    frame = Frame(depth, camera, picture, name="ball")
    labels = (tsdf < 0).astype(np.int32) * (objects > 0)
    return SceneEstimate(items, grid, tsdf, labels, frame, {})


@pytest.mark.parametrize(
    ("objects", "colour"),
    [
        (1, True),
        (0, True),
        pytest.param(1, False, marks=pytest.mark.exhaustive),
        pytest.param(13, True, marks=pytest.mark.exhaustive),
    ],
)
def test_overview_is_a_picture_with_the_objects_colour(tmp_path, objects, colour):
    estimate = estimate_of(objects=objects, colour=colour)
    colours = [(0.0, 0.4, 0.9)] * objects
    views = two_views(solid_of(estimate, colours), estimate)
    write_overview(tmp_path / "o.png", estimate, estimate.tsdf, colours, views)
    picture = np.asarray(Image.open(tmp_path / "o.png").convert("RGB")).astype(int)
    assert min(picture.shape[:2]) > 800
    blue = picture[..., 2] - picture[..., 0] > 100
    lower = picture.shape[0] // 2
    if objects:
        assert blue[lower:].mean() > 0.03
    else:
        assert blue[lower:].mean() < 0.03
    assert [path.name for path in tmp_path.iterdir()] == ["o.png"]


def test_titles_have_letters_of_other_alphabets():
    """What a font doesn't have is drawn as the same box."""
    masks = [np.asarray(font_of(14).getmask(letter)) for letter in "\u00e4\u00df\u0416\u03b1\uffff"]
    for mask in masks[:-1]:
        assert mask.shape != masks[-1].shape or (mask != masks[-1]).any()


def test_the_legend_has_every_object(tmp_path):
    estimate = estimate_of(objects=13)
    colours = [(0.5, 0.5, 0.5)] * 12 + [(1.0, 0.0, 0.0)]
    views = two_views(solid_of(estimate, colours), estimate)
    write_overview(tmp_path / "o.png", estimate, estimate.tsdf, colours, views)
    picture = np.asarray(Image.open(tmp_path / "o.png").convert("RGB")).astype(int)
    red = (picture[..., 0] > 250) & (picture[..., 1:].max(axis=-1) < 5)
    assert red[-100:].sum() > 100
