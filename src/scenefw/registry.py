"""The catalogue of components: every option of every config group, core and plugins together.

Listing reads file names and first comments only; nothing is imported until something is built.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from scenefw import config, plugins
from scenefw.core.errors import ConfigError

PACKAGES = {
    "shape": "shapes",
    "scene": "scenes",
    "engine": "scenes",
    "representation": "representations",
    "renderer": "renderers",
    "mapping": "mapping",
    "noise": "noise",
    "noise_in_turns": "noise",
    "dataset": "data",
    "viewpoints": "scenes",
    "augmentation": "data",
    "model": "models",
    "loss": "losses",
    "matching": "matching",
    "metric": "metrics",
    "postprocessing": "postprocessing",
    "labelling": "labelling",
    "label_source": "labelling",
    "map_label_source": "labelling",
    "key_frames": "labelling",
    "optimizer": "learning",
    "learning": "learning",
    "trainer": "learning",
    "callback": "learning",
    "logger": "learning",
    "evaluation": "evaluation",
    "report": "report",
    "run": "tasks",
    "grid": "core",
    "paths": "",
    "scale": "",
    "experiment": "",
    "ablation": "",
    "launcher": "",
    "debug": "",
}
"""Config group and the package of its components ("" = settings only)."""


def catalogue() -> dict[str, dict[str, Path]]:
    """Files of all options by group and name; groups in the order of `PACKAGES`, then others."""
    groups: dict[str, dict[str, Path]] = {group: {} for group in PACKAGES}
    for folder in (config.conf_dir(), *(plugin.conf for plugin in plugins.find())):
        for path in sorted(folder.glob("*/*.yaml")):
            if path.parent.name != "hydra":
                groups.setdefault(path.parent.name, {})[path.stem] = path
    return {group: options for group, options in groups.items() if options}


def names(group: str) -> list[str]:
    """The options of a group.

    Raises:
        ConfigError: there is no such group.
    """
    return sorted(_options(group))


def describe(group: str, name: str) -> str:
    """The one line that a config says about itself: its first comment."""
    return description(_file(group, name))


def description(path: Path) -> str:
    """The first comment of a config that isn't its `@package` line; empty if there is none."""
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            break
        text = line.lstrip("# ").strip()
        if not text.startswith("@package"):
            return text
    return ""


def build(group: str, name: str, **overrides: Any) -> Any:
    """Builds one component with its defaults from the config and these arguments changed.

    Raises:
        ConfigError: no such group, option or argument.
    """
    from hydra.errors import InstantiationException
    from hydra.utils import instantiate

    _file(group, name)
    plugins.activate()
    whole = config.compose([f"+{group}@component={name}"])
    unknown = sorted(set(overrides) - {str(key) for key in whole.component})
    if unknown:
        known = sorted(str(key) for key in whole.component if key != "_target_")
        misses = config.near_misses(unknown[0], known)
        raise ConfigError(f"{group} {name} has no argument '{unknown[0]}'; {misses}")
    try:
        return instantiate(whole.component, _convert_="all", **overrides)
    except InstantiationException as error:
        raise ConfigError(f"cannot build {group} {name}: {config.squash(error)}") from error


def _options(group: str) -> dict[str, Path]:
    groups = catalogue()
    if group not in groups:
        raise ConfigError(f"no group '{group}'; {config.near_misses(group, list(groups))}")
    return groups[group]


def _file(group: str, name: str) -> Path:
    options = _options(group)
    if name not in options:
        misses = config.near_misses(name, list(options))
        raise ConfigError(f"group {group} has no option '{name}'; {misses}")
    return options[name]
