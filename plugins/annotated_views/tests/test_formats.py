"""BOP and COCO: what is written is read back by our own reader, trimesh and pycocotools."""

import json

import numpy as np
import pytest
import trimesh
from PIL import Image
from pycocotools import coco
from pycocotools import mask as masks
from scipy.spatial.distance import pdist

from scenefw.data.batches.stacks import StackScenes
from scenefw.data.files.readers import read_frame
from scenefw.scenes.cameras import RandomViewpoints
from scenefw_annotated_views.annotation_files import in_units
from scenefw_annotated_views.bop import BOP
from scenefw_annotated_views.coco import COCO, run_lengths
from scenefw_annotated_views.scenes import StackViews
from scenefw_single_view_benchmarks.visible_masks import VisibleMasks


@pytest.fixture(scope="module")
def source():
    viewpoints = RandomViewpoints(64, 48, centre=(0.55, 0.1, 0.1))  # some of it outside the image
    return StackViews(StackScenes("stacks_v2", "test", 2), viewpoints, detail=6)


def written(form, source, root):
    keys = [source.keys(scene) for scene in range(2)]
    numbers = {key: i for i, key in enumerate((k for some in keys for k in some), start=1)}
    for scene in range(2):
        folder = root / "test" / f"{scene:06d}"
        form.write_scene(folder, source.views(scene, 2), [numbers[key] for key in keys[scene]])
    form.finish(root, source, numbers)
    return numbers


@pytest.fixture(scope="module")
def bop(source, tmp_path_factory):
    root = tmp_path_factory.mktemp("bop")
    written(BOP(), source, root)
    return root


def loaded(path):
    return json.loads(path.read_text())


def image(path):
    return np.array(Image.open(path))


def test_bop_is_read_back(source, bop):
    for scene in range(2):
        folder = bop / "test" / f"{scene:06d}"
        for number, view in enumerate(source.views(scene, 2)):
            frame = read_frame(folder / "depth" / f"{number:06d}.png")
            near = np.where(view.frame.depth < 6.5, view.frame.depth, frame.depth)
            np.testing.assert_allclose(frame.depth, near, atol=5.1e-5)
            np.testing.assert_allclose(frame.camera.matrix, view.frame.camera.matrix)
            labels = VisibleMasks(0).of(folder / "depth" / f"{number:06d}.png")
            seen = [one.visible for one in view.silhouettes if one.visible.any()]
            numbered = sum(n * mask for n, mask in enumerate(seen, start=1))
            np.testing.assert_array_equal(labels, numbered)
            for i, one in enumerate(view.silhouettes):
                name = f"{number:06d}_{i:06d}.png"
                assert np.array_equal(image(folder / "mask" / name), 255 * one.mask)
                assert np.array_equal(image(folder / "mask_visib" / name), 255 * one.visible)


def test_models_at_their_poses_are_where_the_depth_image_shows_them(source, bop):
    folder = bop / "test" / "000001"
    cameras, truths = loaded(folder / "scene_camera.json"), loaded(folder / "scene_gt.json")
    for number in ("0", "1"):
        matrix = np.array(cameras[number]["cam_K"]).reshape(3, 3)
        depth = image(folder / "depth" / f"{int(number):06d}.png") * cameras[number]["depth_scale"]
        for i, truth in enumerate(truths[number]):
            mesh = trimesh.load(bop / "models" / f"obj_{truth['obj_id']:06d}.ply", process=False)
            turn = np.array(truth["cam_R_m2c"]).reshape(3, 3)
            mask = image(folder / "mask_visib" / f"{int(number):06d}_{i:06d}.png") > 0
            v, u = np.nonzero(mask)
            if not len(v):
                continue
            seen = (
                depth[mask][:, None]
                * np.stack([u, v, np.ones(len(u))], 1)
                @ np.linalg.inv(matrix).T
            )
            own = (seen - truth["cam_t_m2c"]) @ turn
            _, distance, _ = trimesh.proximity.closest_point_naive(mesh, own[::7])
            assert distance.max() < 0.2  # mm, of depth in steps of 0.1
            world = np.array(cameras[number]["cam_R_w2c"]).reshape(3, 3)
            item = source.objects(1)[i]
            np.testing.assert_allclose(world @ item.pose.rotation, turn, atol=1e-6)
            place = world @ item.pose.position * 1000 + cameras[number]["cam_t_w2c"]
            np.testing.assert_allclose(place, truth["cam_t_m2c"], atol=1e-3)


def test_bop_says_of_silhouettes_what_the_masks_show(bop):
    cut = 0
    for folder in (bop / "test").iterdir():
        for number, infos in loaded(folder / "scene_gt_info.json").items():
            depth = image(folder / "depth" / f"{int(number):06d}.png")
            for i, info in enumerate(infos):
                name = f"{int(number):06d}_{i:06d}.png"
                whole, shown = (image(folder / kind / name) > 0 for kind in ("mask", "mask_visib"))
                assert info["px_count_visib"] == shown.sum()
                assert info["px_count_valid"] == (whole & (depth > 0)).sum()
                assert info["px_count_all"] >= whole.sum()
                assert info["visib_fract"] == pytest.approx(shown.sum() / info["px_count_all"])
                if not shown.any():
                    assert info["bbox_visib"] == info["bbox_obj"] == [-1] * 4
                    continue
                rows, columns = np.nonzero(shown)
                corner = [columns.min(), rows.min()]
                assert info["bbox_visib"] == [*corner, np.ptp(columns), np.ptp(rows)]
                if info["px_count_all"] > whole.sum():
                    cut += 1
                    left, top, width, height = info["bbox_obj"]
                    assert min(left, top) < 0 or left + width >= 64 or top + height >= 48
    assert cut  # or the test has no object that the image cuts


def test_models_of_bop(source, bop):
    infos = loaded(bop / "models" / "models_info.json")
    assert len(infos) == sum(len(source.keys(scene)) for scene in range(2))
    for number, info in infos.items():
        mesh = trimesh.load(bop / "models" / f"obj_{int(number):06d}.ply", process=False)
        assert mesh.is_watertight
        assert mesh.volume > 0
        assert info["diameter"] == pytest.approx(pdist(mesh.vertices).max(), rel=1e-5)
        np.testing.assert_allclose(mesh.bounds.sum(axis=0), 0, atol=1e-3)
        for axis, name in enumerate("xyz"):
            assert info[f"min_{name}"] == pytest.approx(mesh.bounds[0, axis], abs=1e-3)
            assert info[f"size_{name}"] == pytest.approx(np.ptp(mesh.bounds[:, axis]), abs=1e-3)
        outward = mesh.vertex_normals * trimesh.Trimesh(mesh.vertices, mesh.faces).vertex_normals
        assert (outward.sum(axis=1) > 0.99).all()
    camera = loaded(bop / "camera.json")
    assert (camera["width"], camera["height"], camera["depth_scale"]) == (64, 48, 0.1)


def test_coco_is_read_by_pycocotools(source, bop, tmp_path):
    numbers = written(COCO(), source, tmp_path)
    known = coco.COCO(str(tmp_path / "annotations_test.json"))
    assert [each["name"] for each in known.loadCats(known.getCatIds())] == ["object"]
    assert len(known.getImgIds()) == 4
    seen = 0
    for entry in known.loadImgs(known.getImgIds()):
        path = tmp_path / entry["file_name"]
        scene, view = entry["scene_id"], int(path.stem)
        assert image(path).shape == (entry["height"], entry["width"]) == (48, 64)
        true = list(source.views(scene, 2))[view]
        assert np.array_equal(image(path), in_units(true.frame.depth))
        models = [numbers[key] for key in source.keys(scene)]
        for one in known.loadAnns(known.getAnnIds(entry["id"])):
            silhouette = true.silhouettes[models.index(one["object_id"])]
            assert np.array_equal(known.annToMask(one), silhouette.visible)
            packed = masks.frPyObjects(one["amodal_segmentation"], 48, 64)
            assert np.array_equal(masks.decode(packed), silhouette.mask)
            assert one["amodal_bbox"] == masks.toBbox(packed).tolist()
            shown = known.annToRLE(one)
            assert one["bbox"] == masks.toBbox(shown).tolist()
            assert one["area"] == masks.area(shown)
            assert one["visibility"] == pytest.approx(silhouette.visibility)
            seen += 1
    assert seen == sum(
        one.visible.any()
        for scene in range(2)
        for view in source.views(scene, 2)
        for one in view.silhouettes
    )


@pytest.mark.parametrize("mask", [np.zeros((3, 2), bool), np.ones((3, 2), bool), np.eye(3) > 0])
def test_run_lengths(mask):
    packed = masks.frPyObjects(run_lengths(mask), *mask.shape)
    assert np.array_equal(masks.decode(packed), mask)


def test_depth_that_is_too_far_for_16_bits_is_not_measured():
    assert in_units(np.array([[0.0, 1.00004, 6.5535, 6.56]])).tolist() == [[0, 10000, 65535, 0]]
