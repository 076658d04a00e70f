"""The catalogue of components: every option of every config group, core and plugins together.

Listing reads file names and first comments only; nothing is imported until something is built.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from scenefw import config, plugins
from scenefw.core.errors import ConfigError

META = "_group.yaml"  # says what a group is; files and folders named _... hold no options


@dataclass(frozen=True)
class Group:
    """What a group's `_group.yaml` says.

    Args:
        name: as it is typed.
        about: one line.
        package: where its components are written: in `scenefw`, or `scenefw_...` of a plugin; "" if
            it holds settings alone.
        protocols: each component satisfies one of them: names in the core's protocols, or dotted.
        verbs: options of `run` that read it, or `any`.
    """

    name: str
    about: str = ""
    package: str = ""
    protocols: tuple[str, ...] = ()
    verbs: tuple[str, ...] = ()


def catalogue() -> dict[str, dict[str, Path]]:
    """Files of all options by group and name; groups in the order of the root, then others."""
    files: dict[str, dict[str, Path]] = {}
    for folder in folders():
        for group, name, path in config.files_in(folder):
            if config.is_option(name):
                files.setdefault(group, {})[name] = path
    return {group: files[group] for group in _ordered(files)}


def files() -> Iterator[Path]:
    """Files of all settings: options, and what they share."""
    for folder in folders():
        yield from sorted(folder.rglob("*.yaml"))


def groups() -> dict[str, Group]:
    """Metadata of every group, in the order of `catalogue`; only the name if it has no metadata."""
    return {name: group(name) for name in catalogue()}


def group(name: str) -> Group:
    """The metadata of one group.

    Raises:
        ConfigError: its metadata has an unknown key.
    """
    files = (folder / name / META for folder in folders())
    path = next((file for file in files if file.is_file()), None)
    metadata = {} if path is None else settings(path)
    unknown = sorted(metadata.keys() - {field.name for field in fields(Group)})
    if unknown:
        raise ConfigError(
            f"{path} has a key '{unknown[0]}'; expected about, package, protocols, verbs"
        )
    lists = {key: tuple(metadata.get(key) or ()) for key in ("protocols", "verbs")}
    return Group(name, str(metadata.get("about", "")), str(metadata.get("package") or ""), **lists)


def options(group: str) -> dict[str, Path]:
    """Files of a group's options by name.

    Raises:
        ConfigError: there is no such group.
    """
    files = catalogue()
    if group not in files:
        raise ConfigError(f"no group '{group}'; {config.near_misses(group, list(files))}")
    return files[group]


def folders() -> list[Path]:
    """Where options are: the core's folder, then those of plugins."""
    return [config.conf_dir(), *(plugin.conf for plugin in plugins.find())]


def named_beside(path: Path, entry: str) -> Path | None:
    """The file that an entry of a defaults list names in its own group; None if there is none.

    Hydra looks from the folder of the group for what an option `thesis/simstack` names, and from
    the folder of the file for what a file named by it names in turn.
    """
    roots = folders()
    root = next((folder for folder in roots if path.is_relative_to(folder)), path.parents[1])
    group = path.parent.relative_to(root)
    places = (group, group.parent)
    files = (base / place / f"{entry}.yaml" for base in (root, *roots) for place in places)
    return next((file for file in files if file.is_file()), None)


def settings(path: Path) -> dict[str, Any]:
    """A YAML file as written, references unresolved.

    Raises:
        ConfigError: it is no YAML.
    """
    import yaml
    from omegaconf import OmegaConf

    try:
        loaded: Any = OmegaConf.to_container(OmegaConf.load(path), resolve=False)
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise ConfigError(f"{path} can't be read as YAML: {config.squash(error)}") from error
    return {str(key): value for key, value in loaded.items()} if isinstance(loaded, dict) else {}


def _ordered(group_names: Iterable[str]) -> list[str]:
    """Groups as `config.yaml` chooses them, then those that it doesn't know."""
    places = _places(config.conf_dir() / f"{config.ROOT_CONFIG}.yaml")
    return sorted(group_names, key=lambda name: (places.get(name, len(places)), name))


@functools.cache
def _places(root: Path) -> dict[str, int]:
    """Where the root config chooses each group; that file doesn't change while a program runs."""
    entries = settings(root)["defaults"]
    group_names = [str(next(iter(entry))) for entry in entries if isinstance(entry, dict)]
    return {name: place for place, name in enumerate(group_names)}


def names(group: str) -> list[str]:
    """The options of a group.

    Raises:
        ConfigError: there is no such group.
    """
    return sorted(options(group))


def describe(group: str, name: str) -> str:
    """The one line that a config says about itself: its first comment."""
    return description(_file(group, name))


def description(path: Path) -> str:
    """The first comment of a config that isn't its `@package` line; empty if there is none."""
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        if not line.startswith("#"):
            break
        text = line.lstrip("# ").strip()
        if not text.startswith("@package"):
            return text
    return ""


def build(group: str, name: str, **overrides: Any) -> Any:
    """Builds one component with the defaults of its config, except for these arguments.

    Raises:
        ConfigError: no such group, option or argument.
    """
    from hydra.errors import InstantiationException
    from hydra.utils import instantiate

    _file(group, name)
    plugins.activate()
    composition = config.compose([f"+{group}@component={name}"])
    unknown = sorted(set(overrides) - {str(key) for key in composition.component})
    if unknown:
        arguments = sorted(str(key) for key in composition.component if key != "_target_")
        misses = config.near_misses(unknown[0], arguments)
        raise ConfigError(f"{group} {name} has no argument '{unknown[0]}'; {misses}")
    try:
        return instantiate(composition.component, _convert_="all", **overrides)
    except InstantiationException as error:
        raise ConfigError(f"cannot build {group} {name}: {config.squash(error)}") from error


def _file(group: str, name: str) -> Path:
    files = options(group)
    if name not in files:
        misses = config.near_misses(name, list(files))
        raise ConfigError(f"group {group} has no option '{name}'; {misses}")
    return files[name]
