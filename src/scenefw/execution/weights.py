"""Which weights a run uses."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from scenefw.core.errors import CheckpointError
from scenefw.execution.build import LATER

_LOADER = "scenefw.learning.checkpoint.load_checkpoint"


def used_weights(config: Mapping[str, Any], key: str = "run") -> dict[str, str]:
    """SHA-256 of each file of weights that a node of a resolved config loads, by file name.

    Of files of one name, all but the first have their folder's name too. Files that are missing are
    left out: what loads them says so.

    Args:
        config: the whole, as plain data.
        key: of the node; those that it builds later count too.
    """
    nodes = list(_loaders(_at(config, key), config))
    if not nodes:
        return {}
    from scenefw.learning.checkpoint import weights_file
    from scenefw.learning.provenance import digest

    digests: dict[str, str] = {}
    for node in nodes:
        try:
            path = weights_file(node.get("path"), node.get("shipped") or "simstack")
        except CheckpointError:
            continue
        if path.is_file():
            digests |= _named(path, digest(path), digests)
    return digests


def _named(path: Path, sha256: str, digests: Mapping[str, str]) -> dict[str, str]:
    is_unambiguous = digests.get(path.name, sha256) == sha256
    return {path.name if is_unambiguous else f"{path.parent.name}/{path.name}": sha256}


def _loaders(node: Any, config: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    if isinstance(node, Mapping):
        if node.get("_target_") == _LOADER:
            yield node
        if LATER in node:
            yield from _loaders(_at(config, str(node[LATER])), config)
        for value in node.values():
            yield from _loaders(value, config)
    elif isinstance(node, list):
        for value in node:
            yield from _loaders(value, config)


def _at(config: Any, key: str) -> Any:
    """The node of a key; None if there is none."""
    for name in key.split("."):
        config = config.get(name) if isinstance(config, Mapping) else None
    return config
