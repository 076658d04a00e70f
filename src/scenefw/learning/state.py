"""Snapshots of trainings: tensors and plain data in a file, read without running code."""

import io
import warnings
from collections import OrderedDict
from collections.abc import Mapping
from pathlib import Path
from pickle import UnpicklingError
from typing import Any

import torch
from lightning.fabric.plugins import CheckpointIO
from torch import Tensor, nn

from scenefw.core.errors import CheckpointError
from scenefw.core.files import replacing

_PLAIN = (dict, OrderedDict, list, tuple, str, bytes, int, float, bool, type(None))
_TENSORS = (Tensor, nn.Parameter)


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
    path: Path, recipe: Mapping[str, Any], settings: Mapping[str, Any]
) -> dict[str, Any]:
    """The state of a training that can be resumed; checked before the work.

    Args:
        path: of the state.
        recipe: of the network.
        settings: what it learns from and how; validation may change.

    Raises:
        CheckpointError: it is damaged, of another network, or of a training with other settings.
    """
    state = read_state(path, mapped=True)
    try:
        found, facts = dict(state["scenefw"]["recipe"]), dict(state["scenefw"]["facts"])
    except (KeyError, TypeError, ValueError) as error:
        raise CheckpointError(_damaged(f"the state {path}", type(error).__name__)) from error
    different = [k for k in recipe if recipe[k] != found.get(k)]
    if different:
        raise CheckpointError(
            f"the training in {path} had a different network ({', '.join(different)}); start over "
            "with run.fresh=true, or give another paths.training"
        )
    changed = [
        f"{name} {facts.get(name)} instead of {value}"
        for name, value in settings.items()
        if not name.startswith("validation_") and facts.get(name) != value
    ]
    if changed:
        raise CheckpointError(
            f"the training in {path} has different settings ({', '.join(changed)}); start over "
            "with run.fresh=true, or keep this one in its own folder, paths.training=FOLDER"
        )
    return state


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
