"""Pictures of examples: size, colours of what is there, files."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from PIL import Image

from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, GridSpec
from scenefw.evaluation.stacks.examples import Example
from scenefw.kernels.cameras import stack_cameras
from scenefw.mapping.inverse_ray_tracing import InverseRayTracing
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw.report.palette import instance_colours
from scenefw.report.pictures import beside, depth_picture, legend, save_for_document, save_picture
from scenefw.report.stacks.examples import draw_example


@pytest.fixture(scope="module")
def example():
    grid = GridSpec(32)
    centres = grid.centres()
    balls = [((0.0, 0.0, 0.1), 0.1), ((0.15, 0.1, 0.08), 0.08)]
    each = np.stack([np.linalg.norm(centres - c, axis=-1) - r for c, r in balls])
    tsdf = np.clip(each.min(0), -grid.truncation, grid.truncation).astype(np.float32)
    instances = np.where(tsdf < 0, each.argmin(0) + 1, 0).astype(np.int32)
    camera = Camera(160, 120, 145.0, 145.0, 79.5, 59.5, look_at((0.5, -0.6, 0.5), (0, 0, 0.08)))
    cameras = stack_cameras([camera])
    depth = SphereTracer().render(torch.from_numpy(tsdf)[None, None], grid, cameras)
    partial = InverseRayTracing().fuse(depth, grid, cameras)
    one = np.clip(each[0], -grid.truncation, grid.truncation).astype(np.float32)
    only_first = np.where(instances == 1, 1, 0).astype(np.int32)
    return Example(
        "scene 3", grid, depth[0].numpy(), camera, partial.distance[0, 0].numpy(),
        one, only_first, tsdf, instances,
    )  # fmt: skip


def _has_hue(picture, colour):
    """Pixels whose direction from grey is that of a colour."""
    offset = picture - picture.mean(axis=-1, keepdims=True)
    wanted = np.array(colour) - np.mean(colour)
    length = np.linalg.norm(offset, axis=-1)
    cosine = offset @ wanted / np.maximum(length * np.linalg.norm(wanted), 1e-6)
    return ((cosine > 0.95) & (length > 0.1)).sum()


def test_six_views_with_the_objects_in_their_colours(example):
    picture = draw_example(example)
    assert picture.ndim == 3
    assert picture.shape[1] > 900
    first, second = instance_colours(2)
    upper, lower = np.split(picture, [picture.shape[0] // 2])
    predicted = np.concatenate([upper[:, 326:646], lower[:, 326:646]])  # front and back
    true = np.concatenate([upper[:, 652:], lower[:, 652:]])
    assert _has_hue(true, first) > 500
    assert _has_hue(true, second) > 300
    assert _has_hue(predicted, first) > 500
    assert _has_hue(predicted, second) == 0  # the second object was not predicted


@pytest.mark.exhaustive
def test_further_samples_have_a_row_of_their_own(example):
    both = (example.true_tsdf, example.true_instances)
    one = (example.tsdf, example.instances)
    picture = draw_example(replace(example, further_samples=(both, one)))
    plain = draw_example(example)
    assert picture.shape[1] == plain.shape[1]
    row = picture[len(plain) :]
    second = instance_colours(2)[1]
    assert _has_hue(row[:, :320], second) > 300
    assert _has_hue(row[:, 326:646], second) == 0
    np.testing.assert_array_equal(picture[: len(plain)], plain)


def test_depth_picture_leaves_holes_white():
    depth = np.linspace(0.5, 1.0, 100, dtype=np.float32).reshape(10, 10)
    depth[0, 0] = 0
    picture = depth_picture(depth)
    assert (picture[0, 0] == 1).all()
    assert picture[0, 1].sum() > picture[9, 9].sum()  # near is light
    assert (depth_picture(np.zeros((4, 4), np.float32)) == 1).all()


@pytest.mark.parametrize(("size", "small"), [((1250, 500), (1000, 400)), ((300, 700), (300, 700))])
def test_pictures_of_documents_are_small(tmp_path, size, small):
    path = tmp_path / "small.webp"
    save_for_document(Image.new("RGBA", size, "red"), path)
    with Image.open(path) as image:
        assert (image.format, image.size) == ("WEBP", small)
        assert np.abs(np.subtract(image.getpixel((5, 5)), (255, 0, 0))).max() < 8


def test_tiles_in_rows(tmp_path):
    tiles = [np.full((8, 10, 3), i / 4, np.float32) for i in range(4)]
    sheet = beside(tiles, ["a", "b", "c", "d"], columns=2)
    path = tmp_path / "sheet.png"
    save_picture(sheet, path)
    with Image.open(path) as image:
        assert image.size == sheet.shape[1::-1] == (26, 66)


@pytest.mark.parametrize("width", [160, 300, 2000])
def test_a_legend_shows_every_colour_whatever_its_width(width):
    colours = dict(
        zip([f"name of class {i}" for i in range(12)], instance_colours(12), strict=True)
    )
    strip = legend(colours, width)
    assert strip.shape[1] == width
    for colour in colours.values():
        assert (np.abs(strip - np.float32(colour)).max(axis=-1) < 0.003).sum() >= 13 * 13
    assert (strip[:, -2:] == 1).all()  # nothing is cut off
