"""Masks and poses that belong to depth images."""

import json

import numpy as np
import pytest
from PIL import Image
from tests.unit.data.files.test_sequences import write_tum
from tests.unit.perception.synthetic import STACK, camera_at, frame_of

from scenefw.api.image import image_of
from scenefw.core.errors import InputError
from scenefw.core.geometry import inverse
from scenefw.data.files.arrays import frame_of as frame_of_array
from scenefw.data.files.lens import lens_of, undistorted
from scenefw.data.files.sequences import write_sequence
from scenefw.labelling.sources import MaskFiles
from scenefw.tasks.depth_images import DepthImages

STRONG = (0.25, 0.1, 0.0, 0.0, 0.0)
GL = np.diag([1.0, -1.0, -1.0, 1.0])


def views(count=4):
    """Of a table with two boxes, from the left to the right."""
    cameras = [camera_at((0.15 * n - 0.3, -0.8, 0.6), size=(160, 120)) for n in range(count)]
    return [
        frame_of_array(frame_of(camera, STACK).depth, camera, pose=camera.T_world_camera,
                       colour=np.zeros((120, 160, 3), np.uint8))
        for camera in cameras
    ]  # fmt: skip


@pytest.mark.parametrize("wrong", [lambda pose: pose @ GL, inverse])
def test_poses_of_another_convention_are_named_and_then_read(tmp_path, wrong):
    given = views()
    write_sequence(tmp_path, given)
    for image, pose in DepthImages("predict", tmp_path).poses().items():
        number = int(image.stem)
        np.testing.assert_allclose(pose, given[number].camera.T_world_camera, atol=1e-6)
    lines = [" ".join(map(str, wrong(view.camera.T_world_camera).ravel())) for view in given]
    (tmp_path / "poses.txt").write_text("\n".join(lines))
    images = DepthImages("predict", tmp_path)
    with pytest.raises(InputError, match=r"set run\.poses=\w+") as error:
        images.poses()
    convention = str(error.value).rpartition("=")[2]
    poses = list(images.poses(convention).values())
    np.testing.assert_allclose(poses[1], given[1].camera.T_world_camera, atol=1e-6)


def test_poses_of_a_tum_sequence_come_by_time(tmp_path):
    given = views()
    write_tum(tmp_path, given)
    poses = DepthImages("predict", tmp_path).poses()
    assert list(poses) == DepthImages("predict", tmp_path).find()
    for pose, view in zip(poses.values(), given, strict=True):
        np.testing.assert_allclose(pose, view.camera.T_world_camera, atol=1e-6)


def test_images_of_one_name_have_masks_of_their_own(tmp_path):
    for folder, columns in (("a", 10), ("b", 30)):
        depth = tmp_path / "in" / folder / "depth"
        depth.mkdir(parents=True)
        Image.fromarray(np.full((30, 40), 700, np.uint16)).save(depth / "7.png")
        np.savetxt(depth / "K.txt", [[60.0, 0, 19.5], [0, 60, 14.5], [0, 0, 1]])
        mask = tmp_path / "masks" / folder / "depth" / "7.png"
        mask.parent.mkdir(parents=True)
        Image.fromarray(np.tile(np.uint8(np.arange(40) < columns), (30, 1))).save(mask)
    images = DepthImages("predict", tmp_path / "in", masks=tmp_path / "masks")
    first, second = images.find()
    assert [images.read(image)[1].any(axis=0).sum() for image in (first, second)] == [10, 30]
    mask.rename(tmp_path / "masks" / "7.png")
    with pytest.raises(InputError, match=r"7\.png in .* may be of b/depth/7\.png or a/depth/7"):
        images.read(second)


def test_masks_are_freed_of_the_lens_with_their_image(tmp_path):
    camera = camera_at((0, -0.8, 0.6), size=(160, 120))
    depth = frame_of(camera, STACK).depth
    mask = np.zeros(depth.shape, np.uint8)
    mask[20:60, 90:150] = 1
    lens = lens_of(None, STRONG, "a")
    expected = undistorted(lens, camera.matrix, [depth, mask], "a")[1]
    words = {"K": camera.matrix.tolist(), "dist_coeffs": STRONG}
    frame, freed = image_of(depth, words, None, mask, None, "a")
    np.testing.assert_array_equal(freed > 0, expected > 0)
    assert ((freed > 0) != (mask > 0)).sum() > 100
    np.save(tmp_path / "a.npy", depth)
    (tmp_path / "a.json").write_text(json.dumps(words))
    np.testing.assert_array_equal(
        image_of(tmp_path / "a.npy", None, None, mask, None, "")[1], freed
    )
    (tmp_path / "masks").mkdir()
    Image.fromarray(mask).save(tmp_path / "masks" / "a.png")
    images = DepthImages("predict", tmp_path / "a.npy", masks=tmp_path / "masks")
    np.testing.assert_array_equal(images.read(tmp_path / "a.npy")[1] > 0, expected > 0)
    labels = MaskFiles(tmp_path / "masks", ("nothing", "thing"), 0.9).label(frame)
    np.testing.assert_array_equal(labels[1] > 0.5, expected > 0)
