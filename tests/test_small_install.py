"""Training needs few packages, and scenefw itself only on the path, not installed."""

import subprocess
import sys
from pathlib import Path

import pytest

BARRED = ["trimesh", "open3d", "pybullet", "mujoco", "mitsuba", "viser", "coacd", "mesh_to_sdf"]

CODE = f"""
import sys
from importlib import metadata

class Barred:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {BARRED!r}:
            raise ModuleNotFoundError(f"{{name}} is not installed here", name=name)

def version(name, known=metadata.version):
    if name == "scenefw":
        raise metadata.PackageNotFoundError(name)
    return known(name)

sys.meta_path.insert(0, Barred())
metadata.version = version
sys.argv = ["scenefw", *sys.argv[1:]]
from scenefw.__main__ import main
main()
"""


@pytest.mark.parametrize("experiment", [["simstack"], ["label_views", "scale=thesis"]])
def test_a_training_runs_without_simulators_and_mesh_libraries(tmp_path, experiment):
    words = ["run=train", "debug=smoke", "run.name=weights", f"paths.output={tmp_path}/out"]
    words += [f"experiment={experiment[0]}", *experiment[1:]]
    done = subprocess.run(
        [sys.executable, "-c", CODE, *words],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert (Path(tmp_path) / "out" / "weights.safetensors").exists()
