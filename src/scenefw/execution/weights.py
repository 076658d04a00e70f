"""Which weights a run uses."""

from collections.abc import Iterator, Mapping
from typing import Any

from scenefw.core.errors import CheckpointError

_LOADER = "scenefw.learning.checkpoint.load_checkpoint"


def used_weights(config: Any) -> dict[str, str]:
    """SHA-256 of each file of weights that a resolved config loads, by file name.

    Files that are missing are left out: what loads them says so.
    """
    nodes = list(_loaders(config))
    if not nodes:
        return {}
    from scenefw.learning.checkpoint import weights_file
    from scenefw.learning.provenance import digest

    found = {}
    for node in nodes:
        try:
            path = weights_file(node.get("path"), node.get("shipped") or "simstack")
        except CheckpointError:
            continue
        if path.is_file():
            found[path.name] = digest(path)
    return found


def _loaders(node: Any) -> Iterator[Mapping[str, Any]]:
    if isinstance(node, Mapping):
        if node.get("_target_") == _LOADER:
            yield node
        for value in node.values():
            yield from _loaders(value)
    elif isinstance(node, list):
        for value in node:
            yield from _loaders(value)
