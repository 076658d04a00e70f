"""The check must find scenes that move or cut into each other."""

import numpy as np
import pytest

from scenefw.core.errors import ConfigError, StorageError
from scenefw.core.types import Pose, Scene, SceneObject
from scenefw.scenes.storage import pack, save_scenes
from scenefw.shapes.superquadric import Superquadric
from scenefw_publishing.check import Check


def box(z, x=0.0):
    shape = Superquadric([0.05, 0.05, 0.05], [100, 100, 100])
    return SceneObject(shape, Pose(np.array([x, 0, z]), np.array([1.0, 0, 0, 0])), 1.0)


class Lifting:
    """An engine that moves everything up by 1 mm per 100 steps."""

    def reset(self):
        self.items, self.lift = [], 0.0

    def add(self, item):
        self.items.append(item)
        return len(self.items) - 1

    def simulate(self, steps):
        self.lift += steps * 1e-5

    def pose(self, handle):
        pose = self.items[handle].pose
        return Pose(pose.position + np.array([0, 0, self.lift]), pose.quaternion)


def saved(folder, *objects):
    scene = Scene(tuple(objects))
    return save_scenes(folder / "a.npz", pack([scene, scene]), {"attempts": 2, "seed": 0})


def test_measures_and_writes_a_page(tmp_path):
    path = saved(tmp_path, box(0.05), box(0.147))
    task = Check(Lifting(), str(path), number=5, steps=300, page=str(tmp_path / "page.md"))
    figures = task.run()
    assert figures["checked"] == 2
    assert figures["penetration_max"] == pytest.approx(3e-3, abs=1e-4)
    assert figures["shift_max"] == pytest.approx(3e-3, abs=1e-6)
    assert figures["turn_max"] == 0
    text = (tmp_path / "page.md").read_text()
    assert "| 3.00 | 3.00 | 3.00 |" in text
    assert "page.png" in text
    assert (tmp_path / "page.png").exists()


def test_stored_scenes_that_stand_do_not_move(tmp_path):
    pytest.importorskip("pybullet", reason="needs pybullet (pip install 'scenefw[simulation]')")
    from scenefw_simulators.engines.pybullet_engine import PyBulletEngine

    path = saved(tmp_path, box(0.05), box(0.15, 0.01))
    figures = Check(PyBulletEngine(), str(path), page=str(tmp_path / "page.md")).run()
    assert figures["shift_max"] < 1e-3
    assert abs(figures["penetration_max"]) < 1e-4


def test_bad_input(tmp_path):
    with pytest.raises(ConfigError, match=r"run\.number"):
        Check(Lifting(), number=0)
    with pytest.raises(StorageError, match="no scenes at"):
        Check(Lifting(), str(tmp_path / "none.npz")).run()
    path = save_scenes(tmp_path / "a.npz", pack([]), {})
    with pytest.raises(ConfigError, match="no scene to check"):
        Check(Lifting(), str(path)).run()
