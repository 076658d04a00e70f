"""One per-element function, run as a parallel loop on the CPU and as a grid of threads on CUDA.

A kernel file holds a per-element function, a CPU loop over it and a `Kernel` of both:

    @element
    def _double(i, source, target):
        target[i] = 2 * source[i]

    @loop
    def _double_all(count, source, target):
        for i in prange(count):
            _double(np.int64(i), source, target)

    double = Kernel(_double, _double_all)
    double(n, source, target)          # torch tensors of one device, or numbers

The number is cast as numba compiles a parallel loop twice, with signed numbers and with unsigned
ones, and all that it calls with them.

The loop is spelled out because numba caches compiled code of module-level functions only. That
code lies in a folder named by the sources of all kernels and of what they import: an edit there
never meets old code.

Kernels meet neither NaN nor infinity: fast maths on CUDA takes for granted that there are none.
Their callers say in large numbers what is unseen or far.

What numba has just compiled rounds otherwise, in the last bit, than the same read back from its
cache (the bodies of parallel loops are optimised once more there). So that the first run equals all
others, code is compiled in a child process (`child_process`), and this process only ever reads it.
"""

import functools
import hashlib
import inspect
import os
import re
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeAlias

import numba
import numpy as np
import torch
from numba import cuda
from numba.core.sigutils import normalize_signature
from numba.extending import overload
from torch import Tensor

from scenefw.core.cache_folder import cache_folder, is_writable
from scenefw.core.errors import MissingDependencyError, StorageError
from scenefw.kernels.child_process import compile_in_child, is_cached

Argument: TypeAlias = Tensor | float | bool | np.number | tuple[Any, ...]

_IMPORT = re.compile(r"^from scenefw\.([\w.]+) import", re.MULTILINE)
_CACHE = "NUMBA_CACHE_DIR"  # numba's own setting of where compiled code lies
_THREADS_PER_BLOCK = 128
_NO_TOOLKIT = ("DynamicLibNotFoundError", "DynamicLibNotAvailableError")
"""Errors of the finder of CUDA's libraries; numba's own are ImportErrors."""


def sources(package: Path) -> list[Path]:
    """Files of all kernels of scenefw in a folder, and of the modules whose constants they read."""
    paths = set((package / "kernels").glob("*.py"))
    new = paths
    while new:
        modules = {name for file in new for name in _IMPORT.findall(file.read_text("utf-8"))}
        files = {package.joinpath(*name.split(".")).with_suffix(".py") for name in modules}
        new = {file for file in files if file.is_file()} - paths
        paths |= new
    return sorted(paths)


def _cache_folder() -> Path:
    digest = hashlib.sha256(f"{numba.__version__}".encode())
    for source in sources(Path(__file__).parents[1]):
        digest.update(source.read_bytes())
    root = cache_folder()
    if root is None:
        raise StorageError(
            "no folder for compiled kernels can be written, neither the user's cache nor one for "
            f"temporary files; set {_CACHE}=FOLDER to one that can"
        )
    return root / "scenefw" / "kernels" / digest.hexdigest()[:16]


if not os.environ.get(_CACHE):
    numba.config.CACHE_DIR = str(_cache_folder())
elif not is_writable(Path(os.environ[_CACHE])):
    raise StorageError(
        f"compiled kernels can't be written into {_CACHE}={os.environ[_CACHE]}; give a folder that "
        "can be written, or unset it"
    )

_MATHS = {
    "fastmath": {"contract", "arcp", "nsz", "afn", "reassoc"},
    "error_model": "numpy",
}
element = numba.njit(**_MATHS)
loop = numba.njit(parallel=True, cache=True, nogil=True, **_MATHS)
vectorised = numba.njit(inline="always", **_MATHS)
"""An element that becomes part of the loop that calls it: loops with calls are never vectorised."""


_simulated = threading.Lock()  # numba's CUDA simulator runs Python threads
_compiling = threading.Lock()  # one thread compiles, others wait for what it makes
_declared: list[tuple[Any, str]] = []


def atomic_add(array: Any, index: Any, value: Any) -> None:
    """Adds to an array element; atomic on CUDA, where threads share the array."""
    with _simulated:
        array[index] += value


def atomic_min(array: Any, index: Any, value: Any) -> None:
    """Lowers an array element; atomic on CUDA, where threads share the array."""
    with _simulated:
        array[index] = min(array[index], value)


# numba compares the signatures of an overload and of what it returns, annotations included.
@overload(atomic_add, target="cpu")
def _add_on_cpu(array, index, value):  # noqa: ANN001, ANN202
    def add(array, index, value):  # noqa: ANN001, ANN202
        array[index] += value

    return add


@overload(atomic_add, target="cuda")
def _add_on_cuda(array, index, value):  # noqa: ANN001, ANN202
    def add(array, index, value):  # noqa: ANN001, ANN202
        cuda.atomic.add(array, index, value)

    return add


@overload(atomic_min, target="cpu")
def _min_on_cpu(array, index, value):  # noqa: ANN001, ANN202
    def lower(array, index, value):  # noqa: ANN001, ANN202
        array[index] = min(array[index], value)

    return lower


@overload(atomic_min, target="cuda")
def _min_on_cuda(array, index, value):  # noqa: ANN001, ANN202
    def lower(array, index, value):  # noqa: ANN001, ANN202
        cuda.atomic.min(array, index, value)

    return lower


def float32(*values: float) -> tuple[np.float32, ...]:
    """Numbers as kernels take them: a plain float is a double there and widens what it meets."""
    return tuple(np.float32(value) for value in values)


class Kernel:
    """Runs a per-element function over `count` elements on the device of its tensors.

    Args:
        per_element: function of (i, *arguments), made by `element`.
        cpu_loop: function of (count, *arguments), made by `loop`.
        min_shared: fewer elements are one CPU thread's: waking others takes longer, most of all
            beside other processes.
        types: as of `declare`, if predictions or their pictures run the kernel.
    """

    def __init__(
        self,
        per_element: Callable[..., None],
        cpu_loop: Callable[..., None],
        min_shared: int = 1,
        types: str | None = None,
    ) -> None:
        self.per_element = per_element
        self.cpu_loop = cpu_loop
        self.min_shared = min_shared
        if types is not None:
            declare(cpu_loop, types)
        self._cuda_grid: Any = None
        self._compiled_for: set[tuple[Any, ...]] = set()

    def __call__(self, count: int, *arguments: Argument) -> None:
        """Runs all elements; tensors are passed without copies and must be contiguous."""
        if count == 0:  # CUDA refuses a grid without threads
            return
        device = next(a.device for a in arguments if isinstance(a, Tensor))
        if device.type == "cuda":
            with torch.cuda.device(device):
                stream = cuda.external_stream(torch.cuda.current_stream(device).cuda_stream)
                views = [_on_cuda(a) for a in arguments]
                blocks = -(-count // _THREADS_PER_BLOCK)
                try:
                    self._compiled()[blocks, _THREADS_PER_BLOCK, stream](count, *views)
                except (ImportError, RuntimeError) as error:
                    if lacks_toolkit(error):
                        raise _no_toolkit(error) from error
                    raise
        else:
            views = [_on_cpu(a) for a in arguments]
            kinds = tuple(_kind(value) for value in arguments)
            if kinds in self._compiled_for:
                threads = numba.get_num_threads()
                if threads == 1 or count >= self.min_shared:
                    self.cpu_loop(count, *views)
                    return
                numba.set_num_threads(1)
                try:
                    self.cpu_loop(count, *views)
                finally:
                    numba.set_num_threads(threads)
                return
            with _compiling:
                types = tuple(numba.typeof(value) for value in (count, *views))
                compile_in_child(self.cpu_loop, types)
                self.cpu_loop(count, *views)
                self._compiled_for.add(kinds)

    def simulate(self, count: int, *arguments: Argument) -> None:
        """Runs the CUDA grid on CPU tensors in the simulator (NUMBA_ENABLE_CUDASIM=1)."""
        if count == 0:
            return
        blocks = -(-count // _THREADS_PER_BLOCK)
        self._compiled()[blocks, _THREADS_PER_BLOCK](count, *[_on_cpu(a) for a in arguments])

    def _compiled(self) -> Any:
        if self._cuda_grid is None:
            self._cuda_grid = _cuda_grid(self.per_element)
        return self._cuda_grid


def declare(function: Any, types: str) -> None:
    """Says for which types predictions and their pictures call a function: see `compile_ahead`.

    Args:
        function: what numba caches.
        types: numba's, of all arguments, such as `i8, f4[:, ::1]`.
    """
    _declared.append((function, types))


@functools.cache
def compile_ahead() -> None:
    """Compiles what predictions call on a CPU, on all cores at a time, where it isn't cached."""
    calls = [(function, normalize_signature(f"({types})")[0]) for function, types in _declared]
    missing = [call for call in calls if not is_cached(*call)]
    if missing:
        with _compiling, ThreadPoolExecutor(numba.get_num_threads()) as threads:
            list(threads.map(lambda call: compile_in_child(*call), missing))


def _cuda_grid(per_element: Callable[..., None]) -> Any:
    """A CUDA kernel, one thread per element; numba takes no *args there: names are written out."""
    function = getattr(per_element, "py_func", per_element)
    names = ", ".join(list(inspect.signature(function).parameters)[1:])
    source = (
        f"def grid(count, {names}):\n"
        f"    i = cuda.grid(1)\n"
        f"    if i < count:\n"
        f"        per_element(i, {names})\n"
    )
    if not hasattr(np, "row_stack"):  # gone in numpy 2.5, named by numba-cuda all the same
        np.row_stack = np.vstack  # type: ignore[attr-defined]
    scope = {"cuda": cuda, "per_element": per_element}
    exec(source, scope)  # the text above, nothing from outside
    return cuda.jit(fastmath=True)(scope["grid"])


def lacks_toolkit(error: Exception) -> bool:
    """Whether numba says that a driver or a library of CUDA's is missing."""
    return isinstance(error, ImportError) or type(error).__name__ in _NO_TOOLKIT


def _no_toolkit(error: Exception) -> MissingDependencyError:
    reason = " ".join(str(error).split())
    return MissingDependencyError(
        f"numba can't compile for this GPU ({reason}); pip install 'numba-cuda[cu12]' (or [cu13], "
        "as torch.version.cuda says), set CUDA_HOME to a toolkit that has nvvm, or choose "
        "device=cpu"
    )


def _kind(argument: Argument) -> Any:
    """What decides for which types an argument needs code, told faster than by numba."""
    if isinstance(argument, Tensor):
        return argument.dtype, argument.dim()
    if isinstance(argument, tuple):
        return tuple(map(type, argument))
    return type(argument)


def _on_cpu(argument: Argument) -> Any:
    if not isinstance(argument, Tensor):
        return argument
    return _contiguous(argument).detach().numpy()


def _on_cuda(argument: Argument) -> Any:
    if not isinstance(argument, Tensor):
        return argument
    return cuda.as_cuda_array(_contiguous(argument).detach(), sync=False)


def _contiguous(tensor: Tensor) -> Tensor:
    if not tensor.is_contiguous():
        raise ValueError(f"kernel tensors must be contiguous, got strides {tensor.stride()}")
    return tensor
