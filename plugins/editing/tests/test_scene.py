import numpy as np
import pytest
from tests.unit.perception.edited_scenes import scene

from scenefw.api.prediction import Prediction
from scenefw.core.errors import InputError
from scenefw_editing.scene import Scene


@pytest.fixture(scope="module")
def known():
    return Prediction((scene(),)).scene()


def test_each_change_gives_a_new_scene(known):
    changed = known.remove(3).move(2, (0.05, 0, 0)).scale(1, 1.2).add(known[3], (0, 0.2, 0))
    assert repr(known) == "Scene('blocks', objects [1, 2, 3])"
    assert changed.ids == [1, 2, 3]  # 3 is free again
    assert known[2].pose.position[0] == pytest.approx(0, abs=1e-9)
    assert changed[2].pose.position[0] == pytest.approx(0.05)
    assert len(known.swap(1, 2)) == 3
    assert known.add_superquadric((0.05, 0.05, 0.05)).ids == [1, 2, 3, 4]
    assert known.join(known, (0, 0.5, 0)).ids == [1, 2, 3, 4, 5, 6]
    assert [item.id for item in known.remove(1, 2)] == [3]
    assert known.estimate is known.origin
    with pytest.raises(AttributeError):
        known.objects = ()


def test_warnings_say_what_is_wrong(known):
    assert known.warnings == ()
    assert known.remove(1).warnings == ("object 2 hovers 100 mm above the floor",)
    with pytest.raises(InputError, match="there is no object 9; the scene has 1, 2, 3"):
        known.move(9, (0, 0, 1))
    with pytest.raises(InputError, match="there is no object 0"):
        known[0]


def test_a_saved_folder_can_be_read(known, tmp_path):
    folder = known.remove(2).save(tmp_path / "changed")
    assert Scene.read(folder).ids == Scene.read(folder / "scene.json").ids == [1, 3]
    assert known.save(tmp_path / "scene.xml", density=100.0).is_file()
    with pytest.raises(InputError, match=r"no format writes '\.doc'"):
        known.save(tmp_path / "scene.doc")


def test_pictures_show_the_changed_scene(known):
    before, after = known.render(), known.remove(1, 2).render()
    assert before.shape == after.shape == (48, 64, 3)
    changed = np.abs(before.astype(float) - after).max(axis=-1) > 40
    assert 0.02 < changed.mean() < 0.6
    with pytest.raises(InputError, match="Camera"):
        known.render("front")


def test_objects_come_to_rest(known):
    pytest.importorskip("mujoco")
    settled = known.remove(1).settle("engine=mujoco")
    assert settled[2].mesh.vertices[:, 2].min() == pytest.approx(0, abs=0.004)
    assert settled.warnings == ()
    assert settled.estimate.details["settled"]["stable"]


def test_what_is_no_scene_object_or_number_is_named(known):
    with pytest.raises(InputError, match="join takes a Scene, got a int"):
        known.join(3)
    with pytest.raises(InputError, match="what is added is a int"):
        known.add(3)
    with pytest.raises(InputError, match=r"^factor is '2' \(str\)"):
        known.scale(1, "2")
    with pytest.raises(InputError, match=r"^turn is '90' \(str\); expected degrees"):
        known.move(1, turn="90")
