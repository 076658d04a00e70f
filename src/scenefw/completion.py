"""What a shell completes: groups, options and settings, read from files.

Hydra's own completion composes all settings for each key pressed, which takes seconds, shows files
that are no options, and doesn't know `python -m`. Here neither Hydra nor a component is imported.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from scenefw import config, registry
from scenefw.core import assets
from scenefw.listing import composed

SHELLS = ("bash", "zsh")  # zsh by its bashcompinit
UNINSTALL = "complete -r scenefw python python3"
_FLAGS = ("--list", "--help", "--version", "--cfg", "--package", "--hydra-help", "-m", "-v")
_CHOOSING = ("scale", "experiment", "evaluation", "run")  # others too

Options = Mapping[str, Mapping[str, Path]]


def script() -> str:
    """What a shell evaluates to complete scenefw."""
    return Path(__file__).with_suffix(".bash").read_text(encoding="utf-8")


def answers(line: str) -> list[str]:
    """Words that can stand where a command line ends.

    Args:
        line: from its beginning to the cursor.
    """
    words = line.split()
    word = words.pop() if words and not line[-1].isspace() else ""
    command = (i for i, typed in enumerate(words) if Path(typed).name == "scenefw")
    typed = words[next(command, -1) + 1 :]
    options = registry.catalogue()
    candidates: Iterable[str] = _overrides(word, typed, options)
    if typed and typed[-1] == "--list":
        candidates = options
    elif word.startswith("-"):
        candidates = _FLAGS
    return sorted({answer for answer in candidates if answer.startswith(word)})


def _overrides(word: str, typed: list[str], options: Options) -> Iterator[str]:
    """Overrides that begin with the word.

    Behind a `=` these are `group=option` and `key=value` for all known options and values. Before
    it they are the groups and keys that go on with the word: `key=` for a value, `key.` for a node
    that has keys of its own.
    """
    bare = word.lstrip("+~")
    sign = word[: len(word) - len(bare)]
    key, equals, value = bare.partition("=")
    if equals:
        begun = value[: max(value.rfind(","), value.rfind("[")) + 1]  # of a list or a sweep
        yield from (f"{sign}{key}={begun}{name}" for name in _values(key, typed, options))
        return
    path = key.rpartition(".")[0]
    if not path:
        yield from (f"{sign}{group}=" for group in options)
    before = f"{sign}{path}." if path else sign
    node = _node(path, typed, options)
    for name, inner in node.items() if isinstance(node, dict) else ():
        if not name.startswith(("_", "hydra")):
            yield f"{before}{name}{'.' if isinstance(inner, dict) else '='}"


def _values(key: str, typed: list[str], options: Options) -> Iterable[str]:
    """Known values of a group or a setting."""
    if key in options:
        return options[key]
    if key == "checkpoint":
        return assets.weights()
    return ("true", "false") if isinstance(_node(key, typed, options), bool) else ()


def _node(path: str, typed: list[str], options: Options) -> Any:
    """The setting at a path, as written; None if there is none."""
    first, *inner = path.split(".")
    root = registry.settings(config.conf_dir() / f"{config.ROOT_CONFIG}.yaml")
    choices = _choices(root.pop("defaults"), typed, options)
    node: Any = root.get(first) if first else root
    if first in options:
        files = (_file(first, name, options) for name in choices.get(first, ()))
        node = {key: part for file in files if file for key, part in _within(first, file).items()}
    for name in inner:
        node = node.get(name) if isinstance(node, dict) else None
    return node


def _file(group: str, name: str, options: Options) -> Path | None:
    """The file of a choice, also of one that experiments alone make, whose name begins with _."""
    files = (folder / group / f"{name}.yaml" for folder in registry.folders())
    return options[group].get(name) or next((file for file in files if file.is_file()), None)


def _within(group: str, file: Path) -> dict[str, Any]:
    """What an option sets in its own group."""
    settings = composed(file)
    is_global = file.read_text(encoding="utf-8").startswith("# @package _global_")
    return settings.get(group, {}) if is_global else settings


def _choices(root: list[Any], typed: list[str], options: Options) -> dict[str, list[str]]:
    """Chosen options by group: those of the root, changed by what it or the words choose."""
    choices = dict(_entries(root))
    pairs = (word.partition("=") for word in typed)
    typed_choices = {key: value.strip("[]").split(",") for key, _, value in pairs if key in options}
    for group in dict.fromkeys([*_CHOOSING, *typed_choices]):
        for name in typed_choices.get(group, choices.get(group, [])):
            if name in options.get(group, {}):
                choices |= dict(_overridden(options[group][name]))
    return choices | typed_choices


def _overridden(path: Path) -> Iterator[tuple[str, list[str]]]:
    """What a file's list of defaults overrides, and those of files that it names."""
    entries = registry.settings(path).get("defaults", [])
    named = (registry.named_beside(path, entry) for entry in entries if isinstance(entry, str))
    for beside in filter(None, named):
        yield from _overridden(beside)
    yield from _entries(entries)


def _entries(defaults: list[Any]) -> Iterator[tuple[str, list[str]]]:
    """Groups and options of a list of defaults."""
    for entry in defaults:
        for key, value in entry.items() if isinstance(entry, dict) else ():
            group = key.removeprefix("override ").lstrip("/").partition("@")[0]
            yield group, value if isinstance(value, list) else [value]
