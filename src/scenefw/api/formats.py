"""Which class writes which kind of file."""

from __future__ import annotations

import pkgutil
from typing import TYPE_CHECKING, Any

from scenefw import plugins, registry
from scenefw.core.errors import InputError
from scenefw.export.scene_files import GLB, Summary

if TYPE_CHECKING:
    from pathlib import Path

    from scenefw.core.protocols import SceneFormat

_GROUP = "export"
_ALWAYS = (GLB, Summary)  # what predictions write without being asked


def writer(path: Path, settings: dict[str, Any]) -> SceneFormat:
    """What writes a file of this name.

    Args:
        path: its suffix counts, the longer of two.
        settings: arguments of the class.

    Raises:
        InputError: an unknown suffix or setting.
    """
    classes, broken = _formats()
    suffixes = [suffix for suffix in classes if path.name.lower().endswith(suffix)]
    if not suffixes:
        note = f" ({'; '.join(broken)})" if broken else ""
        raise InputError(
            f"no format writes '{path.suffix}' of {path}; give one of {', '.join(classes)}{note}"
        )
    try:
        scene_format: SceneFormat = classes[max(suffixes, key=len)](**settings)
    except TypeError as error:
        raise InputError(f"{path.suffix} files: {error}; see docs/api.md") from error
    return scene_format


def _formats() -> tuple[dict[str, type[Any]], list[str]]:
    """Classes by suffix, of the group `export` too, and which of its options can't be loaded.

    A plugin that is broken must not hurt those who write another format.
    """
    plugins.activate()
    classes: dict[str, type[Any]] = {format_class.suffix: format_class for format_class in _ALWAYS}
    broken = []
    for name, file in registry.options(_GROUP).items():
        for node in registry.settings(file).values():
            if not isinstance(node, dict) or "_target_" not in node:
                continue
            module, _, attribute = node["_target_"].rpartition(".")
            try:
                format_class = pkgutil.resolve_name(f"{module}:{attribute}")
            except (ImportError, AttributeError, SyntaxError, NameError) as error:
                broken.append(f"export={name} can't be loaded: {error}")
                continue
            classes[format_class.suffix] = format_class
    return classes, broken
