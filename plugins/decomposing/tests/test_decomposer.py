"""Whole scenes from Python: what is given as arrays gives what a folder of it gives."""

from dataclasses import replace

import numpy as np
import pytest
from plugins.decomposing.tests.several import PAIR, boxes, fitted_parts
from plugins.decomposing.tests.test_views_observer import frames

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.types import GridSpec
from scenefw.data.files.sequences import write_sequence
from scenefw.export.meshes import write_ply
from scenefw_decomposing.decomposer import Decomposer
from scenefw_decomposing.mesh_views import MeshViews
from scenefw_decomposing.surround import SurroundingCameras

METHOD = Decomposer(
    fitted_parts(grid=GridSpec(resolution=48)),
    MeshViews(SurroundingCameras(240, 180, ring=4)),
    max_views=3,
)


def sizes(prediction):
    return np.array(sorted(sorted(item.extents) for item in prediction.objects))


def test_arrays_and_a_folder_of_them_are_the_same(tmp_path):
    seen = frames()
    depths = [np.rint(frame.depth * 1000).astype(np.uint16) for frame in seen]
    poses = [frame.camera.T_world_camera for frame in seen]
    given = METHOD.decompose(depths, seen[0].camera.matrix, poses, name="walk")
    assert len(given.samples[0].details["views"]) == 3  # of four
    assert repr(given) == "Prediction('walk', 2 objects, 1 samples)"
    read = METHOD.decompose(write_sequence(tmp_path / "walk", seen))
    np.testing.assert_allclose(sizes(read), sizes(given), atol=1e-5)
    np.testing.assert_allclose(
        read.estimate.details["T_world_input"], given.estimate.details["T_world_input"], atol=1e-6
    )


def test_what_files_left_open_is_warned_of(tmp_path):
    blind = replace(frames()[0], depth=np.zeros_like(frames()[0].depth))
    path = write_sequence(tmp_path / "walk", [blind, *frames()[1:]])
    with pytest.warns(UserWarning, match="skipped frames without a measurement: 0"):
        METHOD.decompose(path)


def test_a_mesh(tmp_path):
    write_ply(tmp_path / "pair.ply", boxes(*PAIR))
    found = METHOD.decompose(tmp_path / "pair.ply")
    np.testing.assert_allclose(sizes(found), [[0.08, 0.1, 0.12], [0.1, 0.14, 0.2]], atol=0.01)


def test_bad_input(tmp_path):
    (first, *_) = frames()
    K = first.camera.matrix  # noqa: N806
    with pytest.raises(InputError, match="came with 0 poses and no intrinsics"):
        METHOD.decompose([first.depth])
    with pytest.raises(InputError, match="1 depth images of scene came with 2 poses"):
        METHOD.decompose([first.depth], K, [np.eye(4)] * 2)
    for wrong in (np.diag([2.0, 1, 1, 1]), np.diag([-1.0, 1, 1, 1]), np.full((4, 4), np.nan)):
        with pytest.raises(InputError, match="scene, view 1"):
            METHOD.decompose([first.depth], K, [wrong])
    far = np.eye(4)
    far[0, 3] = 300.0
    with pytest.raises(InputError, match=r"poses of scene are up to 300 m .*millimetres"):
        METHOD.decompose([first.depth] * 2, K, [np.eye(4), far])
    with pytest.raises(InputError, match="got a int; give a path, or a list"):
        METHOD.decompose(3)
    with pytest.raises(InputError, match="got a float; give a path, or a list"):
        METHOD.decompose([first.depth], K, 0.5)
    with pytest.raises(InputError, match="brings its poses and intrinsics"):
        METHOD.decompose(tmp_path, K)
    with pytest.raises(ConfigError, match="mesh_scale = -1"):
        METHOD.decompose(tmp_path / "nix.ply", mesh_scale=-1.0)
    with pytest.raises(InputError, match="there is no view"):
        METHOD.decompose([], K, [])
    with pytest.raises(InputError, match=r"no file or folder .*nix\.ply"):
        METHOD.decompose(tmp_path / "nix.ply")
    with pytest.raises(InputError, match="mesh_scale"):
        METHOD.decompose(tmp_path / "nix.ply", mesh_scale="a")
