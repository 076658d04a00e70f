"""What may be imported where: training and predicting need no simulator and no mesh library."""

import os
import subprocess
import sys
from pathlib import Path

import grimp
import pytest

SOURCE = Path(__file__).parents[1] / "src" / "scenefw"
HEAVY = {
    "open3d",
    "pybullet",
    "mujoco",
    "coacd",
    "manifold3d",
    "trimesh",
    "mesh_to_sdf",
    "pyrender",
}


def modules(*packages):
    for package in packages:
        for path in sorted((SOURCE / package).rglob("*.py")):
            dotted = ".".join(path.relative_to(SOURCE.parent).with_suffix("").parts)
            yield dotted.removesuffix(".__init__")


CODE = """
import importlib, sys
for name in sys.argv[1:]:
    importlib.import_module(name)
print(*{name.split(".")[0] for name in sys.modules})
"""


def imported_with(names):
    command = [sys.executable, "-c", CODE, *names]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split())


@pytest.fixture
def imported_warm(warm, tmp_path):
    """As `imported_with`, where torch and others that take long are imported already."""

    def imported(names):
        (tmp_path / "importing.py").write_text(CODE)
        done = warm("importing", names, tmp_path, dict(os.environ))
        assert done.returncode == 0, done.stderr
        return set(done.stdout.split())

    return imported


def test_the_package_and_the_core_need_numpy_at_most():
    assert "numpy" not in imported_with(["scenefw", "scenefw.core.errors"])
    assert not {"torch", "hydra", "scipy", "numba"} & imported_with(modules("core"))


@pytest.mark.parametrize(
    "packages",
    [
        pytest.param(("learning", "models", "losses", "data", "noise", "mapping"), id="training"),
        pytest.param(("perception", "postprocessing", "export", "renderers"), id="predicting"),
    ],
)
def test_no_simulator_and_no_mesh_library_is_imported(imported_warm, packages):
    assert not HEAVY & imported_warm(modules(*packages))


def test_tasks_are_imported_without_them(imported_warm):
    assert not HEAVY & imported_warm(modules("tasks", "evaluation", "report"))


def test_predicting_does_not_wait_for_lightning():
    assert "lightning" not in imported_with([*modules("perception"), "scenefw.tasks.predict"])


def test_configs_are_read_without_torch():
    assert "torch" not in imported_with(["scenefw.config", "scenefw.registry", "scenefw.plugins"])


@pytest.fixture(scope="module")
def graph():
    """Who imports whom, also for annotations alone."""
    return grimp.build_graph("scenefw", exclude_type_checking_imports=False, cache_dir=None)


@pytest.mark.parametrize("package", ["core", "labelling", "mapping", "evaluation.stacks"])
def test_no_circle_of_imports_even_for_annotations(graph, package):
    inside = graph.find_descendants(f"scenefw.{package}")
    imports = [(a, b) for a in inside for b in graph.find_modules_directly_imported_by(a)]
    assert imports
    circles = [(a, b) for a, b in imports if graph.chain_exists(importer=b, imported=a)]
    assert not circles


def test_packages_hold_a_docstring_only():
    for path in SOURCE.rglob("__init__.py"):
        lines = path.read_text(encoding="utf-8").splitlines()
        assert lines, path
        assert lines[0].startswith('"""'), path
        assert not any(line.startswith(("import ", "from ")) for line in lines), path


def test_no_package_is_called_utils():
    assert not [p for p in SOURCE.rglob("*") if p.stem in {"utils", "helpers", "misc", "common"}]
