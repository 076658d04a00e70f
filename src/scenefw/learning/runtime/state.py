"""Snapshots of trainings: tensors and plain data in a file, read without running code."""

import io
import warnings
from collections import OrderedDict
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from pickle import UnpicklingError
from typing import Any

import torch
from lightning.fabric.plugins import CheckpointIO
from torch import Tensor, nn

from scenefw.core.errors import CheckpointError, ConfigError
from scenefw.core.files import replacing
from scenefw.learning import renamed

_PLAIN = (dict, OrderedDict, list, tuple, str, bytes, int, float, bool, type(None))
_TENSORS = (Tensor, nn.Parameter)
_PARTS: Mapping[str, Any] = {
    "state_dict": Mapping, "optimizer_states": list, "loops": Mapping, "global_step": int,
}  # fmt: skip
_PROGRESS: Mapping[str, Any] = {
    "recipe": Mapping, "facts": Mapping, "batches_seen": int, "samples_seen": int,
    "seconds": int | float, "batches_per_epoch": int,
}  # fmt: skip
OUTCOMES = frozenset(
    ("steps", "samples", "seconds", "epochs", "device", "precision", "command", "commit")
) | {"started_from"}
"""Facts about a training that say what came of it, and where; what it learns from is the rest."""


class StateFiles(CheckpointIO):
    """Reads and writes states for Lightning's trainer, whose own reader may run a file's code."""

    def save_checkpoint(
        self, checkpoint: dict[str, Any], path: Path | str, storage_options: Any = None
    ) -> None:
        """Writes a state, see `write_state`."""
        write_state(path, checkpoint)

    def load_checkpoint(
        self,
        path: Path | str,
        map_location: Any = "cpu",
        weights_only: bool | None = None,
    ) -> dict[str, Any]:
        """Reads a state, see `read_state`."""
        return read_state(path, map_location)

    def remove_checkpoint(self, path: Path | str) -> None:
        """Removes the file, if there is one."""
        Path(path).unlink(missing_ok=True)


def write_state(path: Path | str, state: Mapping[str, Any]) -> None:
    """Writes a state atomically.

    Raises:
        CheckpointError: it holds something that `read_state` would refuse.
        StorageError: the file can't be written.
    """
    _require_plain(state, "")
    file = io.BytesIO()  # torch hides why it could not write to a file
    torch.save(state, file)
    with replacing(path) as temporary:
        temporary.write_bytes(file.getbuffer())


def read_state(
    path: Path | str | io.BytesIO, device: Any = "cpu", *, mapped: bool = False
) -> dict[str, Any]:
    """The state in a file; only tensors and plain data are ever created.

    Args:
        path: of the file, or its bytes.
        device: where its tensors go.
        mapped: read tensors from the file when they are used.

    Raises:
        CheckpointError: it is damaged, or holds something else.
    """
    where = "the state" if isinstance(path, io.BytesIO) else f"the state {path}"
    try:
        with warnings.catch_warnings(action="ignore"):  # the file is refused anyway
            state = torch.load(path, map_location=device, weights_only=True, mmap=mapped or None)
    except UnpicklingError as error:
        raise CheckpointError(
            f"{where} is not a state of a training: it holds more than tensors and plain data, "
            "which could run code and is not loaded; start over with run.fresh=true, or give "
            "another paths.training"
        ) from error
    except Exception as error:  # torch raises many kinds for damaged archives
        raise CheckpointError(_damaged(where, type(error).__name__)) from error
    if not isinstance(state, dict):
        raise CheckpointError(_damaged(where, type(state).__name__))
    return state


def state_to_go_on(
    path: Path,
    recipe: Mapping[str, Any],
    settings: Mapping[str, Any],
    may_change: Collection[str] = (),
) -> dict[str, Any]:
    """The state of a training that can be resumed; checked before the work.

    Args:
        path: of the state.
        recipe: of the network.
        settings: what it learns from and how; validation may change.
        may_change: names of further settings that may be others in this leg of the training.

    Raises:
        CheckpointError: it is damaged, of another network, or of a training with other settings.
        ConfigError: the training has no fact of a name in `may_change`.
    """
    state = read_state(path, mapped=True)
    stored_recipe, facts = _progress(state, path)
    different = [name for name, _, _ in _differences(stored_recipe, recipe)]
    if different:
        raise CheckpointError(
            f"the training in {path} had a different network ({', '.join(different)}); start over "
            "with run.fresh=true, or give another paths.training"
        )
    unknown = sorted({*may_change} - settings.keys() - facts.keys())
    if unknown:
        raise ConfigError(
            f"run.may_change names {unknown[0]}; the facts of this training are "
            f"{', '.join(sorted(settings))}"
        )
    learnt = {name: value for name, value in facts.items() if name not in OUTCOMES}
    changed = [
        f"{name} {before} instead of {now}"
        for name, before, now in _differences(learnt, settings)
        if not name.startswith("validation_") and name not in may_change
    ]
    if changed:
        raise CheckpointError(
            f"the training in {path} has different settings ({', '.join(changed)}); start over "
            "with run.fresh=true, keep this one in its own folder, paths.training=FOLDER, or, if "
            "this is its next leg, name what may change, run.may_change=[batch_size]"
        )
    return state


def _progress(state: Mapping[str, Any], path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """The network's recipe and the facts of a training that can be resumed."""
    missing_names = [name for name, kind in _PARTS.items() if not isinstance(state.get(name), kind)]
    progress = state.get("scenefw")
    progress = progress if isinstance(progress, Mapping) else {}
    missing_names += [
        name for name, kind in _PROGRESS.items() if not isinstance(progress.get(name), kind)
    ]
    if missing_names:
        raise CheckpointError(_damaged(f"the state {path}", f"no {', '.join(missing_names)}"))
    return renamed.recipe(progress["recipe"]), renamed.facts(progress["facts"])


def _differences(
    before: Mapping[str, Any], now: Mapping[str, Any]
) -> Iterator[tuple[str, Any, Any]]:
    """Names of what is not the same, in either, with both values; None: it is not there."""
    for name in {**now, **before}:
        if before.get(name) != now.get(name):
            yield name, before.get(name), now.get(name)


def _damaged(where: str, kind: str) -> str:
    return (
        f"{where} is damaged ({kind}); start over with run.fresh=true, or give another "
        "paths.training"
    )


def _require_plain(value: Any, where: str) -> None:
    if type(value) not in (*_PLAIN, *_TENSORS):
        raise CheckpointError(
            f"the state of a training keeps tensors and plain data, but its {where or 'whole'} is "
            f"a {type(value).__module__}.{type(value).__qualname__}; convert it to one of them"
        )
    if isinstance(value, dict):
        for key, inner in value.items():
            _require_plain(key, f"{where}.{key}".strip("."))
            _require_plain(inner, f"{where}.{key}".strip("."))
    elif isinstance(value, (list, tuple)):
        for number, inner in enumerate(value):
            _require_plain(inner, f"{where}[{number}]")
