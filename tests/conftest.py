"""Settings and fixtures that all tests share."""

import functools
import gc
import os
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings
from tests import parsed
from tests.warm import SHARED, Warm

ROOT = Path(__file__).parents[1]
sys.path += [str(folder) for folder in sorted(ROOT.glob("plugins/*/src"))]

# Compiled kernels make first examples slow, and the same commit must give the same verdict.
settings.register_profile("scenefw", deadline=None, max_examples=20, derandomize=True)
settings.load_profile("scenefw")
parsed.install()
gc.disable()  # until all tests are collected


# Tests of these packages render, fuse, simulate, train, or compile kernels
SLOW = ("api", "evaluation", "kernels", "labelling", "learning", "mapping", "perception",
        "renderers", "scenes", "tasks")  # fmt: skip
SLOW_PLUGINS = ("annotated_views", "decomposing", "doctor", "editing", "grasping",
                "labelling_studies", "onnx", "painting", "rerun", "scene_prior", "serving",
                "several_views", "simulators", "single_view_benchmarks", "tabletops", "things",
                "tracking", "viewer")  # fmt: skip
# These compose all settings, start processes, train, render or draw large pictures
SLOW_FILES = ("test_api_page", "test_argument_types", "test_completion", "test_configs",
              "test_dataset", "test_debug",
              "test_experiments", "test_groups", "test_guide", "test_hypotheses", "test_imports",
              "test_labelling_plugins", "test_listing", "test_overview",
              "test_parsed", "test_pictures", "test_plugins", "test_protocols",
              "test_small_install", "test_splits", "test_training_plugins",
              "test_views", "test_waiting")  # fmt: skip


def pytest_collection_modifyitems(items):
    """Marks what `make quick` leaves out: also whatever runs a command or reads real images.

    What `make test` leaves out is marked as exhaustive where it stands.
    """
    for item in items:
        if is_slow(item.path) or {"warm", "simulator", "real_data"} & set(item.fixturenames):
            item.add_marker("slow")


@functools.cache
def is_slow(path):
    """Whether the tests of a file are."""
    folders = [ROOT / "tests" / "unit" / name for name in SLOW]
    folders += [ROOT / "plugins" / name / "tests" for name in SLOW_PLUGINS]
    inside = any(folder in path.parents for folder in folders)
    return inside or (ROOT / "tests" in path.parents and path.stem in SLOW_FILES)


def pytest_collection_finish():
    """Modules and thousands of collected tests stay: nobody need look for garbage among them."""
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session")
def real_data():
    """Folder of real depth images: SCENEFW_DATA, else ../shared/data beside the project."""
    folder = Path(os.environ.get("SCENEFW_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no real images: {folder} is missing; set SCENEFW_DATA to their folder")
    return folder


@pytest.fixture(scope="session")
def warm():
    """Runs `python -m MODULE ...` without waiting for imports (see `tests.warm`)."""
    yield SHARED.run
    SHARED.stop()


@pytest.fixture(scope="session")
def run_elsewhere(warm):
    """Runs a script of the tests, `python -m MODULE ...`, in a process of its own.

    Libraries that other tests load change how this process rounds (denormal numbers, thread pools),
    and two trainings compared bit by bit would differ in more than what is tested.
    """

    def run(module, *words):
        return warm(module, words, ROOT, dict(os.environ))

    return run


@pytest.fixture(scope="session")
def simulator():
    """A process in which numba simulates CUDA, as it must know at its start."""
    modules = ("torch", "numba.cuda", "scipy.ndimage", "scipy.optimize", "hypothesis", "pytest")
    process = Warm(modules, {"NUMBA_ENABLE_CUDASIM": "1", "NUMBA_DISABLE_JIT": "1"})
    yield process
    process.stop()


@pytest.fixture(scope="module")
def simulated(simulator, tmp_path_factory, request):
    """Arrays by name that `results()` of the test module returns on simulated threads of CUDA."""
    file = tmp_path_factory.mktemp("simulated") / "results.npz"
    words, own = (request.module.__name__, file), {**os.environ, **simulator.variables}
    done = simulator.run("tests.unit.kernels.simulator", words, ROOT, own)
    assert done.returncode == 0, done.stderr
    with np.load(file) as stored:
        return dict(stored)


@pytest.fixture
def full_disk():
    """Gives blocks in which no file grows beyond so many bytes, as on a disk that is full."""
    resource = pytest.importorskip("resource")

    @contextmanager
    def limited(size):
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)

    return limited


@pytest.fixture
def scenefw(tmp_path, warm):
    """Runs `python -m scenefw ...` in an empty folder, as a user would."""

    def run(*words, cwd=None, env=None, timeout=300, unread=()):
        whole = {**os.environ, "COLUMNS": "200", **(env or {})}
        return warm("scenefw", words, cwd or tmp_path, whole, timeout, unread)

    return run
