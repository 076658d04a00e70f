"""Runs modules in processes that are forked from one that has already imported what takes long.

A new Python takes three seconds to import torch and Lightning. Here one process imports them and
scenefw, parses the settings files, lets numba look at what it can compile, and is forked
for each command, which thus starts in milliseconds, as alone as in a process of its own: its own
folder, environment, arguments, output and exit status.
"""

import contextlib
import gc
import importlib
import json
import os
import pkgutil
import runpy
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from pathlib import Path

SLOW = ("hydra", "jinja2", "lightning", "matplotlib.pyplot", "numba.cuda", "rich.progress",
        "scipy.ndimage", "scipy.stats", "skimage.measure", "torch", "torch.utils.tensorboard",
        "torchmetrics")  # fmt: skip
ROOT = Path(__file__).parents[1]
READ_AT_IMPORT = ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "HOME")
"""Variables that modules of scenefw read when they are imported."""


class Warm:
    """The process that is forked; started at its first command, ended with this one.

    It has imported `modules` with `variables` in its environment; one of None is left out there.
    """

    def __init__(self, modules=SLOW, variables=None):
        self.modules = modules
        self.variables = {"PYTHONUNBUFFERED": "", **(variables or {})}
        self._process = None

    def run(self, module, words, cwd, env, timeout=300, unread=()):
        """As `subprocess.run([python, "-m", module, *words], capture_output=True, text=True)`.

        What is `unread` (stdout, stderr) goes into a pipe whose reader is gone.
        """
        if self._process is None or self._process.poll() is not None:
            command = [sys.executable, "-m", "tests.warm", *self.modules]
            own = {**os.environ, **self.variables}
            self._process = subprocess.Popen(
                command,
                cwd=ROOT,
                env={name: value for name, value in own.items() if value is not None},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
        with tempfile.TemporaryDirectory() as folder:
            files = [str(Path(folder) / name) for name in ("stdout", "stderr")]
            read = [None if Path(file).name in unread else file for file in files]
            order = [module, list(map(str, words)), str(cwd), env, read, timeout]
            self._process.stdin.write(json.dumps(order) + "\n")
            self._process.stdin.flush()
            status = int(self._process.stdout.readline())
            out, err = (Path(f).read_text(encoding="utf-8") if f else "" for f in read)
        if status == -signal.SIGALRM:
            raise subprocess.TimeoutExpired([module, *words], timeout, out, err)
        return subprocess.CompletedProcess([module, *words], status, out, err)

    def stop(self):
        if self._process is not None:
            self._process.stdin.close()
            self._process.wait()
            self._process = None


SHARED = Warm()
"""For the tests and those of plugins, whose fixtures of one name are several."""


def serve():
    """Forks for each line of orders on standard input, and answers with its exit status."""
    for name in sys.argv[1:]:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    if "hydra" in sys.modules:
        from tests import parsed

        parsed.install()
        parsed.read(ROOT / "conf")
        _import_scenefw()
        _let_numba_look_around()
    gc.collect()
    gc.freeze()  # else each child looks for garbage among all that torch has made
    for line in sys.stdin:
        order = json.loads(line)
        child = os.fork()
        if not child:
            _become(*order)
        print(_status(child, order[-1]), flush=True)


def _import_scenefw():
    """All modules but those that need a library that isn't there."""
    import scenefw

    for module in pkgutil.walk_packages(scenefw.__path__, "scenefw."):
        if not module.name.endswith("__main__"):
            with contextlib.suppress(ImportError):
                importlib.import_module(module.name)


def _forget_scenefw():
    for name in [name for name in sys.modules if name.partition(".")[0] == "scenefw"]:
        del sys.modules[name]


def _let_numba_look_around():
    """What numba does before it compiles or reads its first function: half a second."""
    from numba.core.registry import cpu_target

    cpu_target.typing_context.refresh()
    cpu_target.target_context.refresh()
    cpu_target.target_context.codegen()


def _status(child, timeout):
    until = time.monotonic() + timeout
    pause = 0.001
    while time.monotonic() < until:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(pause)
        pause = min(2 * pause, 0.05)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return -signal.SIGALRM


def _become(module, words, cwd, env, files, timeout):
    """What `python -m module` does in a new process; never returns."""
    os.setsid()
    for number, file in enumerate(files, start=1):
        os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT) if file else _unread(), number)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.chdir(cwd)
    if any(env.get(name) != os.environ.get(name) for name in READ_AT_IMPORT):
        _forget_scenefw()
    os.environ.clear()
    os.environ.update(env)
    sys.path[0] = cwd
    sys.argv = [module, *words]
    sys.modules.pop("__main__")
    status = 1
    try:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
        status = 0
    except SystemExit as end:
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
        status = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:  # noqa: BLE001 - as Python does at the end of a process
        traceback.print_exc()
    finally:
        os._exit(status if _flushed() else 120)  # as Python says at its end


def _unread():
    """The end of a pipe that nobody reads."""
    reader, writer = os.pipe()
    os.close(reader)
    return writer


def _flushed():
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except (OSError, ValueError):
        return False
    return True


if __name__ == "__main__":
    serve()
