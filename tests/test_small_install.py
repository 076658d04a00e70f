"""Training needs few packages, and scenefw itself only on the path, not installed."""

import os

import pytest

BARRED = [
    "manifold3d",
    "trimesh",
    "open3d",
    "pybullet",
    "mujoco",
    "mitsuba",
    "viser",
    "coacd",
    "mesh_to_sdf",
]

CODE = f"""
import sys
from importlib import metadata

class Barred:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {BARRED}:
            raise ModuleNotFoundError(f"{{name}} is not installed here", name=name)

def version(name, known=metadata.version):
    if name == "scenefw":
        raise metadata.PackageNotFoundError(name)
    return known(name)

assert not set(sys.modules) & set({BARRED}), "imported before it was barred"
sys.meta_path.insert(0, Barred())
metadata.version = version
sys.argv = ["scenefw", *sys.argv[1:]]
from scenefw.__main__ import main
main()
"""


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "words",
    [
        ["experiment=simstack"],
        ["experiment=label_views", "scale=thesis", "size.network=narrow"],  # of rendered views
    ],
    ids=lambda words: words[0],
)
def test_a_training_runs_without_simulators_and_mesh_libraries(tmp_path, warm, words):
    (tmp_path / "small.py").write_text(CODE)
    everywhere = ["run=train", "debug=smoke", "run.name=weights", f"paths.output={tmp_path}/out"]
    done = warm("small", [*words, *everywhere], tmp_path, dict(os.environ))
    assert done.returncode == 0, done.stderr[-3000:]
    assert (tmp_path / "out" / "weights.safetensors").exists()
