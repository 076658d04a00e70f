"""Checkpoints that rebuild themselves: weights, recipe, grid and versions in one file."""

import dataclasses
import importlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import nn

from scenefw.core import assets
from scenefw.core.errors import CheckpointError, ConfigError, SettingError
from scenefw.core.files import replacing
from scenefw.core.types import GridSpec
from scenefw.core.versions import installed
from scenefw.learning import renamed

_FORMAT = "scenefw-checkpoint"
_VERSION = 1

SHAPE_INSTANCE, SEGMENTATION = "shape_instance", "segmentation"
OBJECT_SETS = "object_sets"
SET_FLOW, PART_AFFINITY = "set_flow", "part_affinity"
OBJECT_SHELLS = "object_shells"
"""What a network is for; files without a task are of the first."""


@dataclass(frozen=True)
class Checkpoint:
    """A network ready to predict, with its grid and other facts.

    Args:
        model: in eval mode.
        grid: the voxel grid it was trained on; None for a network of images.
        recipe: class and arguments of the network.
        metadata: how it was trained.
    """

    model: nn.Module
    grid: GridSpec | None
    recipe: dict[str, Any]
    metadata: dict[str, Any]


def shipped_checkpoint(name: str = "simstack") -> Path:
    """Weights that come with scenefw (simstack, label_views, label_maps) or with a plugin.

    Raises:
        CheckpointError: there are none of this name, or several.
    """
    shipped_paths = assets.weights()
    paths = shipped_paths.get(name, [])
    if not paths:
        raise CheckpointError(
            f"no weights {name!r} come with scenefw or its plugins; give a file, or one of "
            f"{', '.join(sorted(shipped_paths))}"
        )
    if len(paths) > 1:
        raise CheckpointError(
            f"weights {name!r} come with {' and '.join(str(path.parent) for path in paths)}; give "
            "the file"
        )
    return paths[0]


def weights_file(name_or_path: Path | str | None, shipped: str = "simstack") -> Path:
    """The file of a path, or of the name of weights that come with scenefw or a plugin.

    Args:
        name_or_path: a path, or a name without a suffix; None means `shipped`.
        shipped: name of the weights that are meant if none are named.

    Raises:
        CheckpointError: no weights have this name.
    """
    if name_or_path is None:
        return shipped_checkpoint(shipped)
    path = Path(name_or_path)
    is_name = not path.suffix and path.name == str(name_or_path) and not path.exists()
    return shipped_checkpoint(path.name) if is_name else path


def save_checkpoint(
    path: Path | str,
    model: nn.Module,
    recipe: Mapping[str, Any],
    grid: GridSpec | None,
    metadata: Mapping[str, Any] | None = None,
    *,
    half: bool = False,
    omit: Sequence[str] = (),
    task: str = SHAPE_INSTANCE,
) -> None:
    """Writes a network with everything needed to rebuild it, atomically.

    Args:
        path: ends in `.safetensors`.
        model: its weights are stored.
        recipe: `_target_` and plain arguments of the network.
        grid: the voxel grid it was trained on; None for a network of images.
        metadata: plain facts of the training.
        half: store weights as float16, for half the size; they are read back as float32.
        omit: children of the network to leave out; None takes their place when it is rebuilt.
        task: what the network is for.

    Raises:
        StorageError: the file can't be written.
    """
    header = {
        "format": _FORMAT,
        "version": _VERSION,
        "task": task,
        "recipe": dict(recipe),
        "grid": dataclasses.asdict(grid) if grid is not None else None,
        "versions": installed(("scenefw", "torch")),
        "metadata": dict(metadata or {}),
        "omitted": list(omit),
    }
    tensors = {}
    for name, value in model.state_dict().items():
        if name.split(".")[0] in omit:
            continue
        value = value.detach().cpu()
        narrow = half and value.dtype == torch.float32 and value.ndim > 1
        tensors[name] = (value.half() if narrow else value).contiguous().clone()
    packed = save(tensors, {_FORMAT: json.dumps(header)})
    with replacing(path) as temporary:  # written here, as safetensors' errors are not OSErrors
        temporary.write_bytes(packed)


def load_checkpoint(
    path: Path | str | None = None,
    device: torch.device | str = "cpu",
    task: str = SHAPE_INSTANCE,
    shipped: str = "simstack",
) -> Checkpoint:
    """Rebuilds a network from a file.

    Args:
        path: of the file, or a name of weights that ship; None means those named `shipped`.
        device: where the network goes.
        task: what it must have been trained for.
        shipped: name of the weights that come with the package.

    Raises:
        CheckpointError: the file is missing, truncated, from elsewhere, from another version or
            for another task, or weights are not finite.
        ConfigError: no path is given, and no weights of this name ship.
    """
    if path is None and shipped not in assets.weights():
        names = ", ".join(sorted(assets.weights()))
        expected = (
            f"a file, as no weights '{shipped}' come with scenefw or its plugins ({names} do)"
        )
        raise SettingError("path", None, expected)
    path = weights_file(path, shipped)
    header, tensors = _read_weights(path)
    stored_task = header.get("task", SHAPE_INSTANCE)
    if stored_task != task:
        raise CheckpointError(
            f"the network in {path} was trained for {stored_task}, expected one for {task}; give "
            "the path of another"
        )
    model = _build(header["recipe"], path)
    for name in header.get("omitted", ()):
        setattr(model, name, None)
    _require_finite(tensors, path)
    weights = {n: v.float() if v.dtype == torch.float16 else v for n, v in tensors.items()}
    try:
        model.load_state_dict(weights)
    except RuntimeError as error:
        raise CheckpointError(
            f"the weights in {path} don't fit the network of its recipe, "
            f"{header['recipe']['_target_']}; use the version of scenefw that wrote it "
            f"({header['versions'].get('scenefw')})"
        ) from error
    model = model.to(device).eval()
    return Checkpoint(model, header["grid"], header["recipe"], header["metadata"])


def read_header(path: Path | str) -> tuple[dict[str, Any], int]:
    """The header of a file, without rebuilding its network, and its number of weights.

    Raises:
        CheckpointError: as `load_checkpoint`.
    """
    with _opened(Path(path)) as (header, stored):
        shapes = [stored.get_slice(name).get_shape() for name in stored.keys()]  # noqa: SIM118
    return header, sum(math.prod(shape) for shape in shapes)


def _read_weights(path: Path) -> tuple[dict[str, Any], dict[str, torch.Tensor]]:
    with _opened(path) as (header, stored):
        return header, {renamed.weight(n): stored.get_tensor(n) for n in stored.keys()}  # noqa: SIM118


@contextmanager
def _opened(path: Path) -> Iterator[tuple[dict[str, Any], Any]]:
    """The header of a file and its tensors, not yet read."""
    if not path.is_file():
        raise CheckpointError(
            f"no checkpoint at {path}; train one with `python -m scenefw run=train`, or give "
            "another file by the setting that names this one (checkpoint=, checkpoints.NAME=)"
        )
    try:
        with safe_open(str(path), framework="pt") as stored:
            notes = stored.metadata() or {}
            if _FORMAT not in notes:
                raise CheckpointError(
                    f"{path} is a safetensors file but not a scenefw checkpoint; give one that "
                    "`run=train` wrote"
                )
            yield _header(notes[_FORMAT], path), stored
    except (SafetensorError, OSError) as error:
        raise CheckpointError(
            f"{path} is truncated or not a safetensors file ({error}); copy or train it again"
        ) from error


def _require_finite(tensors: Mapping[str, torch.Tensor], path: Path) -> None:
    for name, value in tensors.items():
        if value.is_floating_point() and not bool(value.isfinite().all()):
            raise CheckpointError(
                f"{name} in {path} holds values that are not finite; its training diverged or the "
                "file is damaged: copy or train it again"
            )


def _header(text: str, path: Path) -> dict[str, Any]:
    try:
        header = json.loads(text)
        version, wrote = header["version"], header["versions"].get("scenefw")
        if version == _VERSION:
            grid = header["grid"]
            if grid is not None:
                header["grid"] = GridSpec(**{**grid, "lower": tuple(grid["lower"])})
            header["recipe"] = renamed.recipe(header["recipe"])
            header["metadata"] = renamed.facts(header["metadata"])
            header["omitted"] = [renamed.weight(name) for name in header.get("omitted", ())]
    except (ValueError, KeyError, TypeError, AttributeError, ConfigError) as error:
        raise CheckpointError(
            f"the header of {path} is damaged ({error}); copy or train it again"
        ) from error
    if version != _VERSION:
        raise CheckpointError(
            f"{path} has checkpoint version {version}, this scenefw reads {_VERSION}; it was "
            f"written by scenefw {wrote}"
        )
    return header


def _build(recipe: Mapping[str, Any], path: Path) -> nn.Module:
    """The network of a recipe: only network classes of scenefw and its plugins are ever called."""
    target = str(recipe.get("_target_", ""))
    module, _, name = target.rpartition(".")
    arguments = {key: value for key, value in recipe.items() if key != "_target_"}
    if module.split(".")[0].split("_")[0] != "scenefw":
        raise CheckpointError(
            f"{path} names {target!r}, which is not a network of scenefw or a plugin"
        )
    try:
        network_class = getattr(importlib.import_module(module), name)
        if not issubclass(network_class, nn.Module):
            raise CheckpointError(f"{path} names {target!r}, which is not a network")
        return network_class(**arguments)
    except (ImportError, AttributeError, TypeError, ValueError) as error:
        raise CheckpointError(
            f"the network {target!r} of {path} cannot be built ({error}); install the version of "
            "scenefw, or the plugin, that wrote it"
        ) from error
