"""Models from a small folder of ShapeNetCore's layout, written here."""

import numpy as np
import pytest
from PIL import Image

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.height_maps import HeightGrid
from scenefw.renderers.mesh_raycaster import MeshRaycaster
from scenefw_labelling_studies.tables_of_meshes.shapenet import ShapeNetModels, read_model
from scenefw_tabletops.scenes.tabletop import TabletopGenerator

SYNSETS = {"remote_control": "04074963", "keyboard": "03085013"}
LENGTHS = {"remote_control": (0.12, 0.22), "keyboard": (0.25, 0.45)}
_CORNERS = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
_QUADS = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]


def write_box(folder, size, colour=(0.8, 0.2, 0.1), image=None):
    """A box as ShapeNet has it: y up, within a unit diagonal, material or image in a .mtl."""
    models = folder / "models"
    models.mkdir(parents=True)
    half = np.array(size) / np.linalg.norm(size) / 2
    lines = ["mtllib model_normalized.mtl"]
    lines += ["v {} {} {}".format(*(half * corner)) for corner in _CORNERS]
    lines += ["vt 0.1 0.1", "vt 0.9 0.1", "vt 0.9 0.9", "vt 0.1 0.9", "usemtl paint"]
    lines += ["f " + " ".join(f"{v}/{i + 1}" for i, v in enumerate(quad)) for quad in _QUADS]
    (models / "model_normalized.obj").write_text("\n".join(lines) + "\n")
    material = "newmtl paint\nKd {} {} {}\n".format(*colour)
    if image is not None:
        (folder / "images").mkdir()
        Image.new("RGB", (8, 8), image).save(folder / "images" / "texture0.png")
        material += "map_Kd ../images/texture0.png\n"
    (models / "model_normalized.mtl").write_text(material)
    return models / "model_normalized.obj"


@pytest.fixture
def root(tmp_path):
    for number in range(8):
        write_box(tmp_path / SYNSETS["remote_control"] / f"{number:032x}", (1, 0.5, 3))
        write_box(tmp_path / SYNSETS["keyboard"] / f"{number:032x}", (4, 0.3, 1.3))
    (tmp_path / SYNSETS["keyboard"] / "empty").mkdir()
    return tmp_path


def test_models_are_laid_flat_at_real_sizes(root):
    models = ShapeNetModels(str(root), SYNSETS, LENGTHS)
    assert models.classes == ("surface", "remote_control", "keyboard")
    for label, proportion in ((1, (3, 1, 0.5)), (2, (4, 1.3, 0.3))):
        mesh = models.model(label, 2)
        size = np.ptp(mesh.vertices, axis=0)
        least, greatest = LENGTHS[models.classes[label]]
        assert least <= size[0] <= greatest
        assert np.allclose(size / size[0], np.array(proportion) / proportion[0])
        assert mesh.vertices[:, 2].min() == pytest.approx(0)
        corners = mesh.vertices[mesh.faces]
        volume = np.linalg.det(corners).sum() / 6
        assert volume == pytest.approx(size.prod())  # positive: not mirrored
    assert models.model(1, 0) is models.model(1, 0)
    assert np.ptp(models.model(1, 0).vertices) != np.ptp(models.model(1, 1).vertices)


@pytest.mark.parametrize("size", [(1, 2, 3), (3, 2, 1), (2, 1, 3), (3, 1, 2), (1, 3, 2), (2, 3, 1)])
def test_whatever_stands_is_laid_down(tmp_path, size):
    mesh = read_model(write_box(tmp_path, size), 0.3)
    assert np.allclose(np.ptp(mesh.vertices, axis=0), [0.3, 0.2, 0.1])
    assert np.linalg.det(mesh.vertices[mesh.faces]).sum() > 0


def test_colours_of_materials_and_images(tmp_path):
    plain = read_model(write_box(tmp_path / "a", (1, 1, 2), (0.8, 0.2, 0.1)), 0.1)
    assert np.allclose(plain.colours, np.array([0.8, 0.2, 0.1]) ** 2.2, atol=0.01)
    painted = read_model(write_box(tmp_path / "b", (1, 1, 2), image=(0, 128, 255)), 0.1)
    expected = (np.array([0, 128, 255]) / 255) ** 2.2
    assert np.allclose(painted.colours, expected, atol=0.02)


def test_splits_are_by_category(root):
    models = ShapeNetModels(str(root), SYNSETS, LENGTHS, count=7)
    parts = [list(models.instances(1, split)) for split in ("train", "validation", "test")]
    assert parts == [[0, 1, 2, 3, 4], [5], [6]]


def test_scenes_of_such_models_render(root):
    generator = TabletopGenerator(ShapeNetModels(str(root), SYNSETS, LENGTHS))
    geometry = generator.geometry(generator.generate(0, 0))
    found = MeshRaycaster().height_map(geometry, HeightGrid(vertices=65))
    assert set(np.unique(found.labels)) == {0, 1, 2}


def test_bad_input(root, tmp_path):
    with pytest.raises(ConfigError, match="need the folder of ShapeNetCore"):
        ShapeNetModels(None, SYNSETS, LENGTHS)
    with pytest.raises(ConfigError, match="lengths has no keyboard"):
        ShapeNetModels(str(root), SYNSETS, {"remote_control": (0.1, 0.2)})
    with pytest.raises(InputError, match="for class pen"):
        ShapeNetModels(str(root), {"pen": "03906997"}, {"pen": (0.1, 0.2)})
    broken = tmp_path / "broken.obj"
    broken.write_text("v 0 0\nf 1 2 9\n")
    with pytest.raises(InputError, match=r"broken\.obj"):
        read_model(broken, 0.1)
