import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from tests.unit.perception.pipelines import KnownBoxes, pipeline_of
from tests.unit.perception.synthetic import camera_at, frame_of

from scenefw.core.errors import ConfigError, IncompleteError, InputError, StorageError
from scenefw.core.types import GridSpec
from scenefw.export.superquadrics import Superquadrics
from scenefw.learning.checkpoint import save_checkpoint
from scenefw.models.shape_instance_vae import ShapeInstanceVAE
from scenefw.tasks.predict import Predict
from scenefw_simulators.body_maker import BodyMaker
from scenefw_simulators.engines.pybullet_engine import PyBulletEngine
from scenefw_simulators.settling import PhysicalSettling
from scenefw_simulators.urdf import URDF

CAMERA = camera_at(eye=(0.0, -0.85, 0.6), size=(160, 120))


@pytest.fixture
def pipeline():
    return pipeline_of(KnownBoxes(GridSpec(resolution=32)), samples=2)


def save(path, scale=1000.0, **changes):
    frame = frame_of(CAMERA)
    content = {"depth_mm": np.rint(frame.depth * scale), "K": CAMERA.matrix} | changes
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez(path, **content)
    return path


def names(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("[!.]*") if path.is_file())


def test_one_image_gives_all_files(tmp_path, pipeline):
    image = save(tmp_path / "in" / "view.npz")
    colour = np.full((120, 160, 3), 120, dtype=np.uint8)
    Image.fromarray(colour).save(tmp_path / "in" / "view.rgb.png")
    figures = Predict(image, pipeline, tmp_path / "out").run()
    scene = [
        "masks.png",
        "object_01.ply",
        "object_02.ply",
        "scene.glb",
        "scene.json",
        "volumes.npz",
    ]
    pictures = ["hypotheses.png", "overview.png", "scene.html"]
    files = sorted([*scene, *pictures, *[f"hypothesis_2/{name}" for name in scene]])
    assert names(tmp_path / "out") == [f"view/{name}" for name in files]
    assert figures["images"] == 1
    assert figures["failed"] == 0
    assert figures["objects_per_image"] == 2
    scene = json.loads((tmp_path / "out" / "view" / "scene.json").read_text())
    assert {"objects", "camera", "floor", "versions", "warnings"} <= scene.keys()
    for item in scene["objects"]:
        assert {"id", "centre", "extents", "pose", "confidence", "mesh"} <= item.keys()
        mesh = trimesh.load(tmp_path / "out" / "view" / item["mesh"])
        assert mesh.is_watertight
        np.testing.assert_allclose(mesh.center_mass, item["centre"], atol=1e-4)
        spread = mesh.metadata["_ply_raw"]["vertex"]["data"]["spread"]
        assert np.isfinite(spread).all()
        assert (spread >= 0).all()


def test_without_hypotheses_there_is_one_scene(tmp_path, pipeline):
    image = save(tmp_path / "view.npz")
    Predict(image, pipeline, tmp_path / "out", hypotheses=False).run()
    scene = [
        "masks.png",
        "object_01.ply",
        "object_02.ply",
        "overview.png",
        "scene.glb",
        "scene.html",
        "scene.json",
    ]
    files = [*scene, "volumes.npz"]  # the network gives one volume more
    assert names(tmp_path / "out") == [f"view/{name}" for name in files]


def test_settled_objects_are_what_is_written(tmp_path, pipeline, capsys):
    pytest.importorskip("pybullet", reason="needs pybullet (pip install 'scenefw[simulation]')")
    image = save(tmp_path / "view.npz")
    settling = PhysicalSettling(PyBulletEngine(), BodyMaker())
    task = Predict(
        image, pipeline, tmp_path / "out", settling=settling, overview=False, hypotheses=False
    )
    task.run()
    scene = json.loads((tmp_path / "out" / "view" / "scene.json").read_text())
    assert [row["id"] for row in scene["settled"]["objects"]] == [1, 2]
    assert "view: settled: object 1 moved" in capsys.readouterr().out
    meshes = [trimesh.load(tmp_path / "out" / "view" / one["mesh"]) for one in scene["objects"]]
    for item, mesh in zip(scene["objects"], meshes, strict=True):
        np.testing.assert_allclose(mesh.center_mass, item["centre"], atol=1e-4)
    assert min(mesh.bounds[0, 2] for mesh in meshes) == pytest.approx(0, abs=2e-3)


def test_further_files_are_written_for_every_scene(tmp_path, pipeline):
    image = save(tmp_path / "view.npz")
    exports = {"urdf": URDF(), "superquadrics": Superquadrics()}
    Predict(image, pipeline, tmp_path / "out", overview=False, exports=exports).run()
    for folder in ("view", "view/hypothesis_2"):
        found = set(names(tmp_path / "out" / folder))
        assert {"scene.urdf", "scene.superquadrics.json", "scene_urdf/object_02.urdf"} <= found


def test_masks_say_which_objects_count(tmp_path, pipeline):
    image = save(tmp_path / "in" / "view.npz")
    task = Predict(image, pipeline, tmp_path / "out", overview=False, masks=tmp_path)
    with pytest.raises(InputError, match=r"no mask .*view\.png"):
        task.run()
    Image.fromarray(np.uint8(frame_of(CAMERA).labels == 0)).save(tmp_path / "view.png")
    with pytest.raises(InputError, match="that the mask covers them"):
        task.run()
    Image.fromarray(np.uint8(frame_of(CAMERA).labels > 0)).save(tmp_path / "view.png")
    assert task.run()["objects_per_image"] == 2


def test_a_bad_image_does_not_lose_the_others(tmp_path, pipeline, capsys):
    for name in ("a", "c"):
        save(tmp_path / "in" / f"{name}.npz")
    save(tmp_path / "in" / "b.npz", depth_mm=np.zeros((120, 160)))
    (tmp_path / "in" / "d.npz").write_bytes(b"PK")
    task = Predict(tmp_path / "in", pipeline, tmp_path / "out", overview=False, hypotheses=False)
    with pytest.raises(IncompleteError, match=r"^2 of 4 images are unusable and skipped") as end:
        task.run()
    figures = end.value.figures
    assert (figures["images"], figures["failed"]) == (4, 2)
    assert figures["objects_per_image"] == 2
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["a", "c"]
    told = capsys.readouterr().err
    assert "b.npz: depth of b.npz has no measurement" in told
    assert "d.npz: cannot read" in told


def test_all_bad_is_an_error_of_one_line(tmp_path, pipeline):
    for name in ("a", "b"):
        save(tmp_path / "in" / f"{name}.npz", depth_mm=np.zeros((120, 160)))
    with pytest.raises(InputError, match=r"none of 2 images is usable; the first, .*a\.npz"):
        Predict(tmp_path / "in", pipeline, tmp_path / "out").run()
    with pytest.raises(InputError, match=r"^depth of a\.npz has no measurement"):
        Predict(tmp_path / "in" / "a.npz", pipeline, tmp_path / "out").run()
    assert names(tmp_path / "out") == []


def test_a_rerun_replaces_the_folder(tmp_path, pipeline):
    image = save(tmp_path / "view.npz")
    task = Predict(image, pipeline, tmp_path / "out", overview=False, hypotheses=False)
    task.run()
    before = names(tmp_path / "out")
    (tmp_path / "out" / "view" / "notes.txt").write_text("mine")
    Predict(image, pipeline, tmp_path / "out", page=False, hypotheses=False).run()
    after = {*before, "view/notes.txt", "view/overview.png"} - {"view/scene.html"}
    assert set(names(tmp_path / "out")) == after
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["view"]


def test_a_folder_of_somebody_else_ends_the_run_before_any_image(tmp_path, pipeline):
    for name in ("a", "b"):
        save(tmp_path / "in" / f"{name}.npz")
    (tmp_path / "out" / "b").mkdir(parents=True)
    (tmp_path / "out" / "b" / "notes.txt").write_text("mine")
    with pytest.raises(StorageError, match=r"out/b is no folder of results: .* notes\.txt"):
        Predict(tmp_path / "in", pipeline, tmp_path / "out").run()
    assert names(tmp_path / "out") == ["b/notes.txt"]


def test_a_failure_half_way_leaves_nothing(tmp_path, pipeline, monkeypatch):
    def full(*_):
        raise StorageError("cannot write: no space left on device")

    monkeypatch.setattr("scenefw.export.scene_folder.write_summary", full)
    with pytest.raises(StorageError, match="no space"):
        Predict(save(tmp_path / "view.npz"), pipeline, tmp_path / "out").run()
    assert list((tmp_path / "out").iterdir()) == []


def test_images_of_one_name_get_folders_of_their_own(tmp_path, pipeline):
    save(tmp_path / "in" / "one" / "view.npz")
    save(tmp_path / "in" / "two" / "view.npz")
    frame = frame_of(CAMERA)
    Image.fromarray(np.rint(frame.depth * 1000).astype(np.uint16)).save(
        tmp_path / "in" / "two" / "view.png"
    )
    np.savetxt(tmp_path / "in" / "two" / "intrinsics.txt", CAMERA.matrix)
    figures = Predict(
        tmp_path / "in", pipeline, tmp_path / "out", overview=False, hypotheses=False
    ).run()
    assert figures["failed"] == 0
    found = sorted(
        str(p.parent.relative_to(tmp_path / "out")) for p in (tmp_path / "out").rglob("scene.json")
    )
    assert found == ["one/view", "two/view_npz", "two/view_png"]


def test_an_image_in_a_folder_of_an_images_name_is_kept(tmp_path, pipeline):
    save(tmp_path / "in" / "s" / "a.npz")
    save(tmp_path / "in" / "s" / "a" / "b.npz")
    plain = {"overview": False, "hypotheses": False}
    Predict(tmp_path / "in", pipeline, tmp_path / "out", **plain).run()
    found = {p.parent.relative_to(tmp_path / "out") for p in tmp_path.rglob("scene.json")}
    assert found == {Path("s/a_npz"), Path("s/a/b")}


def test_settings_are_checked(tmp_path, pipeline):
    with pytest.raises(ConfigError, match="input=PATH"):
        Predict(None, pipeline, tmp_path)
    with pytest.raises(ConfigError, match="depth_scale"):
        Predict(tmp_path, pipeline, tmp_path, depth_scale=0)
    for tracking in (None, lambda: None):
        with pytest.raises(ConfigError, match="tracking=objects of the plugin tracking"):
            Predict(tmp_path / "a", pipeline, tmp_path / "out", track=True, tracking=tracking)


def test_output_that_cannot_be_written(tmp_path, pipeline):
    image = save(tmp_path / "view.npz")
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match="cannot write"):
        Predict(image, pipeline, tmp_path / "file" / "out").run()


def test_command_line(tmp_path, scenefw):
    """The whole way from the command line, with an untrained network of a small grid."""
    grid = GridSpec(resolution=16)
    widths = [4] * 5
    model = ShapeInstanceVAE(16, 1, 8, 8, widths, widths, widths, 4, 4)
    recipe = {"_target_": "scenefw.models.shape_instance_vae.ShapeInstanceVAE", **model.recipe}
    save_checkpoint(tmp_path / "net.safetensors", model, recipe, grid)
    image = save(tmp_path / "view.npz")
    words = ["experiment=simstack", "run=predict", "paths.output=out", "device=cpu"]
    words += ["reconstructor=fitted"]  # which reads a checkpoint of such a network
    words += ["run.overview=false", "run.hypotheses=false"]  # pictures are drawn above
    done = scenefw(*words, f"input={image}", "checkpoint=net.safetensors")
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == str(tmp_path / "out")
    assert (tmp_path / "out" / "view" / "scene.json").exists()
    save(tmp_path / "bad.npz", depth_mm=np.full((120, 160), 0.8))
    done = scenefw(*words, f"input={tmp_path / 'bad.npz'}", "checkpoint=net.safetensors")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: depth of bad.npz has a median of 0.8 mm")
    assert not (tmp_path / "out" / "bad").exists()


def test_a_convention_of_poses_that_nobody_reads_is_refused(tmp_path, pipeline):
    image = save(tmp_path / "view.npz")
    with pytest.raises(ConfigError, match=r"only run\.track=true reads"):
        Predict(image, pipeline, poses="opengl")
