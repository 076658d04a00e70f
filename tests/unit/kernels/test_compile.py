import importlib.util
import os
import sys
import threading
import time
from pathlib import Path

import numba
import pytest
import torch
from numba.core.compiler_lock import global_compiler_lock
from numba.core.sigutils import normalize_signature

from scenefw import load
from scenefw.kernels import child_process
from scenefw.kernels import compile as compiling
from scenefw.kernels.compile import Kernel, compile_ahead, lacks_toolkit
from scenefw.report.solids import solids_of
from scenefw.report.window import two_views

DOUBLE = """
import numba

@numba.njit(cache=True)
def double(count, source, target):
    for i in range(count):
        target[i] = 2 * source[i]
"""


class DynamicLibNotFoundError(RuntimeError):
    """Named as that of the finder of CUDA's libraries, which needs not be installed."""


@pytest.mark.parametrize(
    ("error", "lacks"),
    [
        (DynamicLibNotFoundError("nvvm"), True),
        (ImportError("no driver"), True),
        (RuntimeError("out of memory"), False),
        (ValueError("shape"), False),
    ],
)
def test_missing_libraries_of_cuda_are_told_from_other_errors(error, lacks):
    assert lacks_toolkit(error) is lacks


@pytest.fixture
def double(tmp_path, monkeypatch):
    """A loop in a module of its own, which numba keeps beside it."""
    (tmp_path / "doubling.py").write_text(DOUBLE)
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "cache"))
    spec = importlib.util.spec_from_file_location("doubling", tmp_path / "doubling.py")

    def loaded():
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, "doubling", module)  # numba looks there
        spec.loader.exec_module(module)
        return Kernel(module.double, module.double)

    return loaded


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes can't be copied here")
@pytest.mark.parametrize("terminal", [True, False])
def test_who_waits_at_a_terminal_is_told_once_why(double, monkeypatch, capsys, terminal):
    child_process._announce.cache_clear()
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal, raising=False)
    kernel, target = double(), torch.zeros(3)
    for kind in (torch.float32, torch.float64):
        kernel(3, torch.ones(3, dtype=kind), target)
    double()(3, torch.ones(3), target)  # is in the cache
    told = capsys.readouterr().err
    assert told.startswith("compiling kernels, once per machine") == terminal
    assert len(told.splitlines()) == terminal


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes can't be copied here")
def test_a_process_is_copied_only_for_what_is_not_in_the_cache(double, tmp_path, monkeypatch):
    copies, fork = [], os.fork

    def counted():
        copies.append(1)
        return fork()

    monkeypatch.setattr(os, "fork", counted)
    target = torch.zeros(3)
    double()(3, torch.ones(3), target)
    assert target.tolist() == [2, 2, 2]
    assert len(copies) == 1
    double()(3, torch.ones(3), target)  # as the next process does
    assert len(copies) == 1
    double()(3, torch.ones(3, dtype=torch.float64), target)  # of other types
    assert len(copies) == 2
    for file in (tmp_path / "cache").rglob("*.nbc"):
        file.unlink()
    double()(3, torch.ones(3), target)
    assert len(copies) == 3


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes can't be copied here")
def test_what_another_process_has_compiled_meanwhile_is_not_compiled_again(double, monkeypatch):
    answers = [False, True]
    monkeypatch.setattr(child_process, "is_cached", lambda *_: answers.pop(0))
    monkeypatch.setattr(os, "fork", None)
    child_process.compile_in_child(double().cpu_loop, ())
    assert not answers


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes can't be copied here")
def test_what_predictions_call_is_compiled_ahead(double, monkeypatch):
    types = "i8, f4[::1], f4[::1]"
    monkeypatch.setattr(compiling, "_declared", [(double().cpu_loop, types)])
    compile_ahead.__wrapped__()
    monkeypatch.setattr(os, "fork", None)  # nothing is left to compile
    target = torch.zeros(3)
    double()(3, torch.ones(3), target)
    assert target.tolist() == [2, 2, 2]
    compile_ahead.__wrapped__()


def test_predictions_call_what_is_compiled_ahead(real_data):
    image = real_data / "real" / "realsense_table" / "uois_1.npz"
    estimate = load("reconstruction", "reconstructor.samples=2").predict(image).estimate
    two_views(solids_of([estimate])[0], estimate)
    assert len(compiling._declared) >= 10
    for function, types in compiling._declared:
        assert normalize_signature(f"({types})")[0] in function.signatures, function


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes can't be copied here")
def test_a_process_is_copied_while_no_other_thread_compiles(double, monkeypatch):
    held, killed, kill = threading.Event(), [], os.kill

    def compile_something():
        with global_compiler_lock:
            held.set()
            time.sleep(0.5)

    monkeypatch.setattr(child_process, "_PATIENCE", 60.0)  # a copy that waits for ever is killed
    monkeypatch.setattr(os, "kill", lambda *of: (killed.append(of), kill(*of)))
    kernel, target = double(), torch.zeros(3)
    other = threading.Thread(target=compile_something)
    other.start()
    held.wait()
    kernel(3, torch.ones(3), target)
    other.join()
    assert target.tolist() == [2, 2, 2]
    assert not killed


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes can't be copied here")
@pytest.mark.parametrize("limit", ["_PATIENCE", "_STUCK"])
def test_a_copy_that_never_ends_is_killed(double, monkeypatch, limit):
    if limit == "_STUCK" and child_process._computed(os.getpid()) is None:
        pytest.skip("the system doesn't tell what processes compute")
    fork = os.fork

    def stuck():
        child = fork()
        if child == 0:
            time.sleep(600)
        return child

    monkeypatch.setattr(os, "fork", stuck)
    monkeypatch.setattr(child_process, limit, 0.3)
    target, start = torch.zeros(3), time.monotonic()
    double()(3, torch.ones(3), target)
    assert target.tolist() == [2, 2, 2]
    assert time.monotonic() - start < 60  # not all of the other limit


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes can't be copied here")
@pytest.mark.exhaustive
def test_a_copy_that_computes_is_waited_for(double, monkeypatch):
    """Longer than one that only waits would be."""
    fork, killed = os.fork, []

    def slow():
        child = fork()
        if child == 0:
            start = time.process_time()
            while time.process_time() < start + 1.5:
                pass
        return child

    monkeypatch.setattr(os, "fork", slow)
    monkeypatch.setattr(os, "kill", lambda *of: killed.append(of))
    monkeypatch.setattr(child_process, "_STUCK", 1.0)
    target = torch.zeros(3)
    double()(3, torch.ones(3), target)
    assert target.tolist() == [2, 2, 2]
    assert not killed


def test_no_element_is_no_launch():
    """CUDA refuses a grid without threads."""
    kernel = Kernel(None, None)
    kernel(0, torch.zeros(0))
    kernel.simulate(0, torch.zeros(0))


def test_compiled_code_is_of_all_sources_that_its_kernels_read(tmp_path):
    for folder in ("kernels", "core"):
        (tmp_path / folder).mkdir()
    files = {
        "kernels/a.py": "import math\nfrom scenefw.core.sizes import (\n    SIDE,\n)\n",
        "core/sizes.py": "from scenefw.core.deeper import BASE\n",
        "core/deeper.py": "BASE = 1\nif False:\n    from scenefw.core.types import X\n",
        "core/types.py": "",
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    found = [str(path.relative_to(tmp_path)) for path in compiling.sources(tmp_path)]
    assert found == ["core/deeper.py", "core/sizes.py", "kernels/a.py"]
    own = [path.name for path in compiling.sources(Path(compiling.__file__).parents[1])]
    assert {"tabletop.py", "compile.py", "votes.py"} <= set(own)


def test_few_elements_are_one_threads(double, monkeypatch):
    kernel, source = double(), torch.ones(5)
    kernel(3, source, torch.zeros(5))  # compiles
    kernel.min_shared, before, threads = 4, numba.get_num_threads(), []
    monkeypatch.setattr(numba, "set_num_threads", threads.append)
    monkeypatch.setattr(numba, "get_num_threads", lambda: 2)
    for count in (3, 4):
        target = torch.zeros(5)
        kernel(count, source, target)
        assert target.sum() == 2 * count
    assert threads == [1, 2]
    monkeypatch.undo()
    assert numba.get_num_threads() == before
