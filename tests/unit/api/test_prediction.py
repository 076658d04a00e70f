import json
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import trimesh
from tests.unit.perception.pipelines import KnownBoxes, pipeline_of
from tests.unit.perception.synthetic import camera_at, frame_of

from scenefw import registry
from scenefw.api.predictor import Predictor
from scenefw.core.errors import InputError, StorageError
from scenefw.core.types import GridSpec

CAMERA = camera_at(eye=(0.0, -0.85, 0.6), size=(160, 120))


@pytest.fixture(scope="module")
def prediction():
    pipeline = pipeline_of(KnownBoxes(GridSpec(resolution=32)), samples=2)
    return Predictor(pipeline).predict(frame_of(CAMERA).depth, CAMERA, name="boxes")


def test_objects_samples_masks_and_camera(prediction):
    assert repr(prediction) == "Prediction('boxes', 2 objects, 2 samples)"
    assert [item.id for item in prediction.objects] == [1, 2]
    assert prediction.objects is prediction.samples[0].objects
    assert set(np.unique(prediction.masks)) == {0, 1, 2}
    np.testing.assert_allclose(prediction.camera.T_world_camera[2, 3], 0.6, atol=0.01)
    assert prediction.warnings == ()


def test_a_mask_says_where_objects_are():
    predictor = Predictor(pipeline_of(KnownBoxes(GridSpec(resolution=32)), samples=1))
    frame = frame_of(CAMERA)
    assert len(predictor.predict(frame.depth, CAMERA, mask=frame.labels > 0).objects) == 2
    with pytest.raises(InputError, match="mask covers"):
        predictor.predict(frame.depth, CAMERA, mask=frame.labels == 0)
    with pytest.raises(InputError, match="mask of image has shape"):
        predictor.predict(frame.depth, CAMERA, mask=frame.labels[1:] > 0)


@pytest.mark.parametrize("suffix", [".glb", ".ply", ".obj", ".PLY"])
def test_saved_scenes_hold_all_objects(prediction, tmp_path, suffix):
    path = prediction.save(tmp_path / f"scene{suffix}")
    read = trimesh.load(path, process=False)
    mesh = read.to_geometry() if isinstance(read, trimesh.Scene) else read
    meshes = [item.mesh for item in prediction.objects]
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    if suffix == ".glb":  # y up
        vertices = vertices[:, [0, 2, 1]] * (1, 1, -1)
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), np.ptp(vertices, axis=0), atol=1e-5)
    assert len(mesh.faces) == sum(len(mesh.faces) for mesh in meshes)
    parts = mesh.split(only_watertight=True)
    np.testing.assert_allclose(
        sorted(part.volume for part in parts),
        sorted(trimesh.Trimesh(m.vertices, m.faces).volume for m in meshes),
        rtol=1e-3,
    )
    visual = mesh.visual.to_color() if suffix == ".glb" else mesh.visual
    assert len(np.unique(np.asarray(visual.vertex_colors)[:, :3], axis=0)) == 2


def test_json_has_numbers_of_any_sample(prediction, tmp_path):
    path = prediction.save(tmp_path / "scene.json", sample=1)
    told = json.loads(path.read_text())
    assert [item["mesh"] for item in told["objects"]] == [None, None]
    centre = prediction.samples[1].objects[0].pose.position
    np.testing.assert_allclose(told["objects"][0]["centre"], centre)


@pytest.mark.parametrize(("name", "mass"), [("scene.urdf", "mass"), ("scene.xml", "inertial")])
def test_scenes_for_simulators_have_masses(prediction, tmp_path, name, mass):
    def total(density):
        root = ET.parse(prediction.save(tmp_path / name, density=density)).getroot()
        return sum(float(one.get("value") or one.get("mass")) for one in root.iter(mass))

    boxes = 0.2 * 0.16 * 0.12 + 0.1 * 0.11 * 0.08
    assert total(1000.0) == pytest.approx(1000 * boxes, rel=0.1)
    assert total(250.0) == pytest.approx(total(1000.0) / 4)


def test_pictures_show_objects_from_any_side(prediction):
    front = prediction.render()
    assert front.shape == (120, 160, 3)
    assert front.dtype == np.uint8
    lower = prediction.masks == 1
    upper = prediction.masks == 2
    means = [front[mask].astype(float).mean(axis=0) for mask in (lower, upper)]
    assert np.abs(means[0] - means[1]).max() > 40
    behind = prediction.render(prediction.camera.resized(80, 60), turn=180)
    assert behind.shape == (60, 80, 3)
    assert (behind.std(axis=-1) > 20).mean() > 0.1


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (lambda p, f: p.save(f / "scene.stl"), r"no format writes '.stl' .*\.glb, \.json, .*\.ply"),
        (
            lambda p, f: p.save(f / "scene.glb", density=3),
            r"GLB\(\) takes no arguments",
        ),
        (lambda p, f: p.save(f / "scene.glb", sample=2), "no sample 2; give one of 0 to 1"),
        (
            lambda p, f: p.save(f / "scene.glb", sample="a"),
            "sample is 'a'; expected a whole",
        ),
        (lambda p, f: p.save(f / "scene.glb", sample=-1), "sample is -1; expected a whole"),
        (lambda p, f: p.render("front"), "render takes a .*Camera, got a str"),
    ],
)
def test_what_is_wrong_is_one_line(prediction, tmp_path, asked, said):
    with pytest.raises(InputError, match=said):
        asked(prediction, tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_place_that_cannot_be_written(prediction, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match="cannot write"):
        prediction.save(tmp_path / "file" / "scene.glb")


PLUGIN = """
class Names:
    suffix = ".names"

    def write(self, path, estimate, colours):
        path.write_text(" ".join(str(item.id) for item in estimate.objects))
"""


def test_formats_are_those_of_the_group_export(prediction, tmp_path, monkeypatch):
    """A plugin's too; one that can't be loaded is told only where nothing else would do."""
    monkeypatch.syspath_prepend(str(tmp_path))
    options = registry.options("export")
    for name, code in (("names", PLUGIN), ("broken", "import nothing_of_this_name")):
        (tmp_path / f"format_of_{name}.py").write_text(code)
        text = f"# A format\n{name}:\n  _target_: format_of_{name}.Names\n"
        (tmp_path / f"{name}.yaml").write_text(text)
        options[name] = tmp_path / f"{name}.yaml"
    monkeypatch.setattr(registry, "options", {"export": options}.get)
    path = prediction.save(tmp_path / "scene.names")
    assert path.read_text().split() == [str(item.id) for item in prediction.objects]
    with pytest.raises(InputError, match=r"\.names \(export=broken can't be loaded: No module"):
        prediction.save(tmp_path / "scene.stl")
