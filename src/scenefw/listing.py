"""What `--list` shows: groups and options, or the arguments of one group's options.

Everything is read from files; no component is imported.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenefw import plugins, registry
from scenefw.core.errors import ConfigError
from scenefw.core.typed_values import as_typed
from scenefw.docstrings import Argument, arguments

if TYPE_CHECKING:
    from rich.console import Console

Row = tuple[str, str, str]
"""Argument, value, what it is."""


def print_catalogue() -> None:
    """Every group with the verbs that read it, and a line on each of its options."""
    from rich.markup import escape
    from rich.table import Table

    all_plugins = plugins.find()
    owners = {pair: plugin.name for plugin in all_plugins for pair in plugin.options()}
    table = Table("group", "option", "what it is", "plugin", title="scenefw: group=option")
    for group, options in registry.catalogue().items():
        info = registry.group(group)
        table.add_section()
        verbs = f" (run={', '.join(info.verbs)})" if info.verbs else ""
        table.add_row(f"[bold]{group}[/]", "", f"[bold]{escape(info.about)}[/]{escape(verbs)}", "")
        for name, path in sorted(options.items()):
            owner = owners.get((group, name), "")
            table.add_row("", name, escape(registry.description(path)), owner)
    _console().print(table)


def print_group(name: str) -> None:
    """The options of one group with their arguments, the values these have, and what they are.

    Raises:
        ConfigError: there is no such group.
    """
    from rich.markup import escape
    from rich.table import Table

    options = registry.options(name)
    info, console = registry.group(name), _console()
    console.print(f"[bold]{name}[/]: {escape(info.about)}")
    if info.verbs:
        console.print(f"read by run={', '.join(info.verbs)}")
    packages = list(roots())
    for option, path in sorted(options.items()):
        console.print(f"\n[bold]{name}={option}[/]: {escape(registry.description(path))}")
        try:
            rows = list(_rows(composed(path), packages))
        except ConfigError as error:  # of a plugin, which must not hide the others
            console.print(f"[red]{escape(str(error))}[/]")
            continue
        if rows:
            table = Table("argument", "value", "what it is", box=None, padding=(0, 2, 0, 0))
            for row in rows:
                table.add_row(*map(escape, row))
            console.print(table)


def composed(path: Path) -> dict[str, Any]:
    """An option with what its defaults list brings in, references unresolved."""
    settings = registry.settings(path)
    entries = settings.pop("defaults", [])
    composition: dict[str, Any] = {}
    for entry in entries if "_self_" in entries else [*entries, "_self_"]:
        if entry == "_self_":
            _merge(composition, settings)
            continue
        typed, option = next(iter(entry.items())) if isinstance(entry, dict) else ("", entry)
        target = (typed or option).removeprefix("optional ").replace("@_here_", "")
        key, at, place = target.partition("@")
        file = _file(path, key, option if typed else "")
        if file is None or place.startswith("_global_"):  # no part of the option
            continue
        part = composed(file)
        if typed and not at:  # a choice within the group is a part by the folder's name
            place = key
        for name in reversed(place.split(".") if place else []):
            part = {name: part}
        _merge(composition, part)
    return composition


def _file(path: Path, group: str, option: Any) -> Path | None:
    """The file of an entry of a file's defaults list; None for overrides and open choices."""
    inside = group.lstrip("/") + (f"/{option}" if option else "")
    if not group.startswith("/"):
        return registry.named_beside(path, inside)
    files = (folder / f"{inside}.yaml" for folder in registry.folders())
    return next((file for file in files if file.is_file()), None)


def _merge(target: dict[str, Any], part: dict[str, Any]) -> None:
    for name, value in part.items():
        if isinstance(value, dict) and isinstance(target.get(name), dict):
            _merge(target[name], value)
        else:
            target[name] = value


def _rows(node: dict[str, Any], roots: list[Path], prefix: str = "") -> Iterator[Row]:
    """Arguments of a component and of those within it."""
    target = node.get("_target_")
    signature = arguments(target, roots) if isinstance(target, str) else {}
    names = [
        *signature,
        *(name for name in node if name not in signature and not name.startswith("_")),
    ]
    for name in names:
        argument = signature.get(name, Argument(None, ""))
        value: Any = node.get(name)
        inner = isinstance(value, dict) and _has_target(value)
        if target and name in node:
            text = str(value["_target_"]) if inner and "_target_" in value else as_typed(value)
            yield prefix + name, "" if inner and "_target_" not in value else text, argument.about
        elif target:
            yield prefix + name, argument.default or "", argument.about
        if inner:
            yield from _rows(value, roots, f"{prefix}{name}.")


def _has_target(node: dict[str, Any]) -> bool:
    parts = (value for value in node.values() if isinstance(value, dict))
    return "_target_" in node or any(map(_has_target, parts))


def roots() -> Iterator[Path]:
    """Folders that contain packages: the core's and those of plugins."""
    yield Path(__file__).parents[1]
    for plugin in plugins.find():
        if plugin.source is not None:
            yield plugin.source
        elif (spec := importlib.util.find_spec(plugin.package)) and spec.origin:
            yield Path(spec.origin).parents[1]


def _console() -> Console:
    """Cuts nothing when the output is not a terminal."""
    from rich.console import Console

    console = Console(highlight=False)
    return console if console.is_terminal else Console(width=160, highlight=False)
