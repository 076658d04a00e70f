"""The source package makes a wheel, and scenefw works from that alone, without its checkout."""

import json
import os
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core.caching import _CacheLocator

from scenefw.kernels import compile as kernels

ROOT = Path(__file__).parents[1]
PIP = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
ALONE = ["--no-deps", "--no-index"]
EXAMPLES = {"scenefw_object_count", "scenefw_point_cloud"}  # which install by themselves

pytestmark = pytest.mark.exhaustive


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    folder = tmp_path_factory.mktemp("source")
    words = [sys.executable, "-m", "hatchling", "build", "--target", "sdist", "-d", str(folder)]
    subprocess.run(words, cwd=ROOT, check=True, capture_output=True)
    return next(folder.glob("*.tar.gz"))


@pytest.fixture(scope="module")
def wheel(source):
    """Made from the source package, as pip does where no wheel is at hand."""
    how = ["--no-build-isolation", "--wheel-dir", str(source.parent)]
    subprocess.run([*PIP, "wheel", *ALONE, *how, str(source)], check=True)
    return next(source.parent.glob("*.whl"))


@pytest.fixture(scope="module")
def fresh(wheel, tmp_path_factory):
    """The environment of another project: scenefw from the wheel, its dependencies from here."""
    folder = tmp_path_factory.mktemp("fresh")
    venv.create(folder, symlinks=True)
    python = folder / "bin" / "python"
    subprocess.run([*PIP, "--python", str(python), "install", *ALONE, str(wheel)], check=True)
    packages = next(folder.glob("lib/*/site-packages"))
    (packages / "dependencies.pth").write_text(f"{Path(np.__file__).parents[1]}\n")
    lend_compiled_kernels(packages, folder / "cache")
    return folder


def lend_compiled_kernels(packages, cache):
    """What is compiled of the checkout's kernels, for the same sources in another place.

    A cache of its own would have to be filled anew, which `test_first_run` does.
    """
    shared = Path(numba.config.CACHE_DIR)
    own = cache / "scenefw" / "kernels" / shared.name
    own.mkdir(parents=True)
    sources = kernels.__file__, packages / "scenefw" / "kernels" / "compile.py"
    source, target = map(_CacheLocator.get_suitable_cache_subpath, sources)
    (shared / source).mkdir(parents=True, exist_ok=True)
    (own / target).symlink_to(shared / source)


@pytest.fixture
def run(fresh, tmp_path):
    """A command of that environment, in an empty folder far from the checkout."""
    own = {"XDG_CACHE_HOME": str(fresh / "cache")}
    env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | own

    def command(name, *words):
        whole = [str(fresh / "bin" / name), *words]
        done = subprocess.run(
            whole, cwd=tmp_path, env=env, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr[-3000:]
        return done.stdout

    return command


def save_blocks(folder):
    depth = np.full((120, 160), 0.80)
    depth[45:75, 35:65] = 0.70
    depth[50:75, 90:125] = 0.74
    np.savez(folder / "blocks.npz", depth=depth, K=[[150, 0, 79.5], [0, 150, 59.5], [0, 0, 1]])


def test_the_wheel_holds_configs_assets_and_templates(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    assert "scenefw/conf/config.yaml" in names
    assert "scenefw/completion.bash" in names
    configs = {f"scenefw/{p.relative_to(ROOT).as_posix()}" for p in ROOT.glob("conf/*/**/*.yaml")}
    assert len(configs) > 200
    assert configs <= names
    assets = [p for p in (ROOT / "src/scenefw/assets").glob("*") if p.suffix != ".py"]
    assert {f"scenefw/assets/{p.name}" for p in assets if p.is_file()} <= names
    templates = list((ROOT / "src").rglob("*.j2"))
    assert templates
    assert {p.relative_to(ROOT / "src").as_posix() for p in templates} <= names
    assert not [name for name in names if name.startswith(("tests/", "conf/", "plugins/"))]
    for folder in (ROOT / "plugins").glob("*/conf"):
        package = f"scenefw_{folder.parent.name}"
        options = {
            f"{package}/conf/{p.relative_to(folder).as_posix()}" for p in folder.rglob("*.*")
        }
        assert options <= names or package in EXAMPLES


def test_the_source_package_can_be_tested_and_documented(source):
    with tarfile.open(source) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    needed = (
        "Makefile",
        "constraints.txt",
        "mkdocs.yml",
        "docs/quickstart.md",
        "tests/conftest.py",
    )
    assert set(needed) | {"LICENSE", "README.md", "CHANGELOG.md", "CITATION.cff"} <= names


def test_what_is_installed_is_found_elsewhere(fresh, run):
    assert run("scenefw", "--version") == "scenefw 0.1.0\n"
    where = run("python", "-c", "import scenefw; print(scenefw.__file__)")
    assert Path(where.strip()).is_relative_to(fresh)
    assert "renderer=sphere_tracer" in run("scenefw", "--list", "renderer")
    assert "complete -o nospace" in run("scenefw", "-sc", "install=bash")


def test_verbs_of_bundled_plugins_are_there_elsewhere(run):
    verbs = {path.stem for path in ROOT.glob("plugins/*/conf/run/[!_]*.yaml")} - {"point_cloud"}
    listed = run("scenefw", "--list", "run")
    assert all(f"run={verb}" in listed for verb in verbs)


def test_an_image_is_grasped_elsewhere(run, tmp_path):
    save_blocks(tmp_path)
    quick = [
        "run.film=false",
        "run.predict.overview=false",
        "reconstructor.samples=1",
        "grasping.contacts=1",
    ]
    words = ["run=grasp", "reconstructor=network", *quick, "input=blocks.npz", "device=cpu"]
    run("scenefw", *words, "paths.output=out")
    assert json.loads((tmp_path / "out" / "blocks" / "grasps.json").read_text())["grasps"]


def test_an_image_is_predicted_elsewhere(run, tmp_path):
    save_blocks(tmp_path)
    quick = ["reconstructor.samples=1", "run.overview=false", "run.hypotheses=false"]
    words = ["run=predict", "reconstructor=network", *quick, "input=blocks.npz", "device=cpu"]
    said = run("scenefw", *words, "paths.output=out")
    assert said.splitlines()[-1] == str(tmp_path / "out")
    scene = json.loads((tmp_path / "out" / "blocks" / "scene.json").read_text())
    heights = sorted(2 * item["centre"][2] for item in scene["objects"])
    assert heights == pytest.approx([0.06, 0.10], abs=0.03)
    assert (tmp_path / "out" / "blocks" / "scene.glb").stat().st_size > 10_000
