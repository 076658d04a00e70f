"""Real meshes: units, axes, classes, never for training; a folder written here and the real one."""

import json

import numpy as np
import pytest

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.tabletop import DESK
from scenefw_labelling_studies.tables_of_meshes.mesh_folder import MeshFolder
from scenefw_tabletops.scenes.desk import DeskGenerator

PATTERNS = {"pen": "marker", "remote_control": "remote"}
SIZES = {"a_remote": (0.05, 0.16, 0.02), "marker": (0.012, 0.014, 0.13), "soap": (0.09, 0.03, 0.06)}


def write(path, size):
    corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    quads = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]
    lines = ["v {} {} {}".format(*(np.array(size) * corner)) for corner in corners]
    path.write_text("\n".join([*lines, *("f {} {} {} {}".format(*quad) for quad in quads)]))


@pytest.fixture
def root(tmp_path):
    entries = []
    for (name, size), factor in zip(SIZES.items(), (1, 1000, 100), strict=True):
        write(tmp_path / f"{name}.obj", np.array(size) * factor)
        entries.append({"file": f"{name}.obj", "name": name, "extents_m": size})
    (tmp_path / "index.json").write_text(json.dumps(entries))
    return tmp_path


def test_models_get_classes_metres_and_the_shortest_side_up(root):
    models = MeshFolder(str(root), PATTERNS)
    for name, label in (("a_remote", "remote_control"), ("marker", "pen"), ("soap", "other")):
        assert list(models.instances(DESK.index(label), "test")) == [0]
        mesh = models.model(DESK.index(label), 0)
        size = np.ptp(mesh.vertices, axis=0)
        assert size == pytest.approx(sorted(SIZES[name], reverse=True))
        assert mesh.vertices[:, 2].min() == pytest.approx(0)
        volume = np.linalg.det(mesh.vertices[mesh.faces]).sum() / 6
        assert volume == pytest.approx(size.prod())  # positive: no mirror image
    assert not models.instances(DESK.index("keyboard"), "test")


def test_nothing_is_for_training(root):
    models = MeshFolder(str(root), PATTERNS)
    for split in ("train", "validation"):
        assert all(not models.instances(label, split) for label in range(1, len(DESK)))


def test_they_lie_on_tables(root):
    models = MeshFolder(str(root), PATTERNS)
    generator = DeskGenerator(models, scenes=(0, 0, 2), minimum=6, maximum=9)
    items = generator.generate(1, 0).items
    assert len(items) > 3
    assert {DESK[item.label] for item in items} <= {"remote_control", "pen", "other"}
    with pytest.raises(ConfigError, match=r"scene 2 is outside 0\.\.1"):
        generator.generate(2, 0)


def test_fine_meshes_become_coarser(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(5, 0.04)
    ball.export(tmp_path / "ball.ply")
    entry = {"file": "ball.ply", "name": "ball", "extents_m": [0.08] * 3}
    (tmp_path / "index.json").write_text(json.dumps([entry]))
    mesh = MeshFolder(str(tmp_path), PATTERNS, faces=2000).model(DESK.index("other"), 0)
    assert 500 < len(mesh.faces) <= 2000 < len(ball.faces)
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx([0.08] * 3, rel=0.05)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"extents_m": [0.3, 0.2]}, "entry 0 of .* is unusable"),
        ({"file": "none.obj"}, "names none.obj, which is missing"),
        ({"extents_m": [0.31, 0.1, 0.1]}, "times as large as extents_m says"),
    ],
)
def test_entries_that_say_what_is_not(root, change, said):
    entries = json.loads((root / "index.json").read_text())
    entries[0].update(change)
    (root / "index.json").write_text(json.dumps(entries))
    with pytest.raises(InputError, match=said):
        MeshFolder(str(root), PATTERNS).model(DESK.index("remote_control"), 0)


def test_folders_and_patterns_that_are_not_there(tmp_path):
    with pytest.raises(ConfigError, match=r"give models\.root=FOLDER"):
        MeshFolder(None, PATTERNS)
    with pytest.raises(InputError, match="can't be read"):
        MeshFolder(str(tmp_path), PATTERNS)
    with pytest.raises(ConfigError, match="patterns for spoon"):
        MeshFolder(str(tmp_path), {"spoon": "spoon"})


def test_the_real_folder(real_data):
    root = real_data / "meshes"
    if not root.is_dir():
        pytest.skip(f"no meshes in {real_data}")
    from scenefw import registry

    models = registry.build("shape", "tabletop_meshes", root=str(root))
    for name in ("remote_control", "model_plane", "pen", "book", "other"):
        label = DESK.index(name)
        assert len(models.instances(label, "test")) >= 1
        size = np.ptp(models.model(label, 0).vertices, axis=0)
        assert 0.01 < size.max() <= 0.34
        assert size[2] == min(size)
