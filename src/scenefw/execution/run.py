"""One run: builds the chosen task from its config, and records how its results were made."""

from __future__ import annotations

import gc
import itertools
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from scenefw import plugins, registry
from scenefw.core.cache_folder import share_with_matplotlib
from scenefw.core.errors import ConfigError, IncompleteError
from scenefw.core.files import keeping, require_writable, write_text
from scenefw.core.rng import torch_seed
from scenefw.core.versions import versions
from scenefw.execution import final_split
from scenefw.execution.build import Builder
from scenefw.execution.leftovers import FIGURES, RECORD, SETTINGS, Leftovers
from scenefw.execution.modifiers import make_deterministic, profiled
from scenefw.execution.parts import require_types
from scenefw.execution.places import (
    KEPT,
    require_input,
    require_no_strangers,
    require_values,
    strangers,
)
from scenefw.execution.reads import require_read
from scenefw.execution.threads import require_threads, threads
from scenefw.execution.weights import used_weights

if TYPE_CHECKING:
    from omegaconf import DictConfig

_INITIAL_WEIGHTS = 6  # random stream, beside those of `learning`


def execute(config: DictConfig) -> Mapping[str, Any]:
    """Runs the task of a composed config; returns its figures.

    Writes `config.yaml` (resolved) and `run.json` (versions, seed, command line, overrides, SHA-256
    of weights) before the work starts and `metrics.json` after it, all in `paths.output`. Until all
    parts are built nothing is written; then the figures of an earlier run in the folder go, as they
    are not of this one. A run that fails or is stopped before it has made anything leaves the
    folder as it was.

    Raises:
        StorageError: the output folder can't be written.
        ConfigError: a setting is wrong.
        IncompleteError: part of the work could not be done; the figures of the rest are written.
    """
    from hydra.core.hydra_config import HydraConfig
    from omegaconf import OmegaConf

    overrides: list[str] = []
    choices: Mapping[str, Any] = {}
    if HydraConfig.initialized():  # a sweep gives each run its own folder and settings
        config.paths.output = HydraConfig.get().runtime.output_dir
        # As typed: `grid=${grid}` stays that
        task = OmegaConf.to_container(HydraConfig.get().overrides.task, resolve=False)
        overrides = [str(override) for override in cast("list[Any]", task)]
        choices = HydraConfig.get().runtime.choices
    require_values(overrides)
    require_seed(config.seed)
    require_threads(config.threads)
    share_with_matplotlib()
    plugins.activate()
    options = registry.catalogue()
    require_read(config, overrides, options, choices)
    require_input(config)
    require_types(config, "run", overrides, options)
    output = Path(config.paths.output).absolute()
    foreign_files = strangers(output) if _is_given() else []
    output = _own_folder(output)
    config.paths.output = str(output)
    before = Leftovers(output, keep_folder=_is_given())
    try:
        with keeping(foreign_files):
            figures = _work(config, output, overrides, foreign_files)
    except IncompleteError:
        print(output)
        raise
    except (Exception, KeyboardInterrupt):
        before.restore()
        raise
    print(output)
    return figures


def _own_folder(output: Path) -> Path:
    """The folder given by name, else one that no other run has."""
    if _is_given():
        require_no_strangers(output)
        return require_writable(output)
    return claim(output)


def _is_given() -> bool:
    return any(word.startswith("paths.output=") for word in sys.argv[1:])


def _work(
    config: DictConfig, output: Path, overrides: list[str], foreign_files: list[Path]
) -> dict[str, Any]:
    """Builds the task and runs it; its figures."""
    from omegaconf import OmegaConf

    config.device = pick_device(config.device)
    resolved = OmegaConf.to_yaml(config, resolve=True)
    plain: Any = OmegaConf.to_container(config, resolve=True)
    record = {
        "seed": config.seed,
        "versions": versions(),
        "command": sys.argv[1:],
        "overrides": overrides,
        "weights": used_weights(plain),
    }
    if foreign_files:  # a later run keeps them, too
        record[KEPT] = sorted(file.name for file in foreign_files)
    if config.get("deterministic"):
        make_deterministic()
    _seed_initial_weights(config.seed)
    with final_split.access(config):
        task = Builder(config).build("run")
        (output / FIGURES).unlink(missing_ok=True)
        write_text(output / SETTINGS, resolved)
        write_text(output / RECORD, json.dumps(record, indent=2) + "\n")
        _collect_garbage()
        with threads(config.threads, yields=config.yielding):
            figures, failure = _figures(task, output, profile=bool(config.get("profile")))
    if used_weights(plain) != record["weights"]:  # the run itself trained some of them
        record["weights"] = used_weights(plain)
        write_text(output / RECORD, json.dumps(record, indent=2) + "\n")
    write_text(output / FIGURES, json.dumps(figures, indent=2) + "\n")
    if failure is not None:
        raise failure
    return figures


def _figures(
    task: Any, output: Path, *, profile: bool
) -> tuple[dict[str, Any], IncompleteError | None]:
    try:
        return dict(profiled(task.run, output) if profile else task.run()), None
    except IncompleteError as failure:
        return failure.figures, failure


def _collect_garbage() -> None:
    """From now on, as the command line does not; modules, settings and parts are here to stay."""
    if not gc.isenabled():  # the first run of a sweep
        gc.freeze()
        gc.enable()


def require_seed(seed: Any) -> None:
    """Checks a seed before the work.

    Raises:
        ConfigError: it is not a whole number of 0 or more.
    """
    if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
        raise ConfigError(f"seed is {seed}; expected a whole number of 0 or more, such as seed=1")


def _seed_initial_weights(seed: int) -> None:
    """New networks draw from torch's global generator, which other runs of a sweep have used."""
    import torch

    torch.manual_seed(torch_seed(seed, _INITIAL_WEIGHTS))


def claim(folder: Path) -> Path:
    """The folder, or its next free neighbour (`-2`, ...) if a run of the same second has it."""
    names = itertools.chain([folder.name], (f"{folder.name}-{n}" for n in itertools.count(2)))
    return next(filter(_is_free, map(folder.with_name, names)))


def _is_free(folder: Path) -> bool:
    """Takes the folder, unless it is taken."""
    require_writable(folder)
    try:
        (folder / RECORD).touch(exist_ok=False)
    except FileExistsError:
        return False
    return True


def pick_device(device: str) -> str:
    """The device to use: `auto` takes the GPU where both torch and numba can use it.

    Raises:
        ConfigError: a GPU is requested but there is none, or the name is unknown.
    """
    if device == "cpu":
        return "cpu"
    import torch

    if device == "auto":
        return "cuda" if torch.cuda.is_available() and _numba_has_gpu() else "cpu"
    if not str(device).startswith("cuda"):
        raise ConfigError(f"device={device} is unknown; give cpu, cuda or auto")
    if not torch.cuda.is_available():
        raise ConfigError(f"device={device} but torch sees no GPU; give device=cpu")
    return str(device)


def _numba_has_gpu() -> bool:
    from numba import cuda

    return bool(cuda.is_available())
