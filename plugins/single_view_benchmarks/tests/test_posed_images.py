import numpy as np
import pytest
import trimesh

from scenefw.core.errors import ConfigError, InputError
from scenefw_single_view_benchmarks.posed_images import PosedImages


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "meshes").mkdir()
    trimesh.creation.box((0.1, 0.06, 0.04)).export(tmp_path / "meshes" / "box.ply")
    depth = np.full((48, 64), 800, np.uint16)
    instances = np.zeros((48, 64), np.int16)
    instances[10:20, 10:20], instances[:5] = 1, -1
    pose = np.eye(4)
    pose[:3, 3] = (0.0, 0.0, 0.8)
    np.savez(
        tmp_path / "a.npz",
        depth_mm=depth,
        K=np.array([[60.0, 0, 32], [0, 60, 24], [0, 0, 1]]),
        obj_names=np.array(["box"]),
        T_cam_obj=pose[None],
        instances=instances,
    )
    return tmp_path


def test_an_image_has_its_objects_in_the_coordinates_of_its_camera(folder):
    images = PosedImages(folder, folder / "meshes")
    assert (len(images), images.keys(0), images.categories) == (1, ["box"], ("box",))
    (view,) = images.views(0, 3)
    np.testing.assert_allclose(view.frame.depth, 0.8, atol=1e-6)
    np.testing.assert_array_equal(view.frame.camera.T_world_camera, np.eye(4))
    assert view.silhouettes[0].pixels == 100
    assert view.unknown.sum() == 48 * 64 - 100
    (item,) = view.objects
    np.testing.assert_allclose(item.pose.position, (0, 0, 0.8))
    np.testing.assert_allclose(np.ptp(item.mesh.vertices, axis=0), (0.1, 0.06, 0.04), atol=1e-6)
    assert images.facts() == {"images": ["a.npz"], "meshes": ["box"]}


def test_what_is_missing_is_said(folder, tmp_path_factory):
    with pytest.raises(ConfigError, match="meshes=FOLDER"):
        PosedImages(folder, None)
    with pytest.raises(InputError, match="holds no posed image"):
        PosedImages(tmp_path_factory.mktemp("empty"), folder)
    with pytest.raises(InputError, match=r"no mesh .*box\.ply"):
        PosedImages(folder, folder)
    np.savez(folder / "b.npz", depth_mm=np.ones((4, 4)))
    with pytest.raises(InputError, match=r"b\.npz is no posed image"):
        PosedImages(folder, folder / "meshes")


def test_instances_in_another_order_than_the_poses_are_told(folder):
    arrays = dict(np.load(folder / "a.npz"))
    beside = np.eye(4)
    beside[:3, 3] = (0.25, 0.0, 0.8)
    arrays["T_cam_obj"] = np.stack([arrays["T_cam_obj"][0], beside])
    arrays["obj_names"] = np.array(["box", "box"])
    arrays["instances"][:] = 0
    arrays["instances"][22:26, 28:36] = 2  # in the middle, where the first box is
    arrays["instances"][22:26, 46:54] = 1
    np.savez(folder / "a.npz", **arrays)
    (view,) = PosedImages(folder, folder / "meshes").views(0)
    assert [np.argwhere(s.visible)[0].tolist() for s in view.silhouettes] == [[22, 28], [22, 46]]
    (note,) = view.frame.notes
    assert "a.npz: its poses say that objects 1 to 2 are instances 2, 1" in note
    arrays["instances"] = np.choose(arrays["instances"], [0, 2, 1])
    np.savez(folder / "a.npz", **arrays)
    (view,) = PosedImages(folder, folder / "meshes").views(0)
    assert not view.frame.notes
