"""Plugins: folders in `plugins/` and packages installed by pip, found without importing them.

Bundled plugins are part of scenefw's distribution: in a checkout they are folders of its `plugins`,
in the wheel packages that its entry points name. So both are found without a step.

A plugin is `<name>/{pyproject.toml, src/<package>/, conf/<group>/<option>.yaml}`; its pyproject
declares `[project.entry-points."scenefw.plugins"]` with one line `name = "package"`. What a
group of its own is, `conf/<group>/_group.yaml` says.
"""

from __future__ import annotations

import functools
import importlib.util
import logging
import os
import sys
import tomllib
from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from scenefw.config import conf_dir, files_in, is_option, package_dir, search_also
from scenefw.core import assets
from scenefw.core.errors import ConfigError
from scenefw.core.files import utf8_text

ENTRY_POINTS = "scenefw.plugins"
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Plugin:
    """A plugin that was found.

    Args:
        name: as declared in its entry point.
        package: the Python package that its configs point to.
        conf: folder of its options.
        source: folder that must join `sys.path`, None if pip installed it.
        assets: folder of weights that it brings, in its package.
    """

    name: str
    package: str
    conf: Path
    source: Path | None = None
    assets: Path | None = None

    def options(self) -> Iterator[tuple[str, str]]:
        """Pairs (group, option) of everything it adds."""
        return ((group, name) for group, name in self.files() if is_option(name))

    def files(self) -> Iterator[tuple[str, str]]:
        """The same, with what are not options: `_group` and files that options share."""
        return ((group, name) for group, name, _ in files_in(self.conf))


def activate() -> tuple[Plugin, ...]:
    """Finds all plugins, makes them importable and their options known to Hydra.

    Raises:
        ConfigError: two plugins, or a plugin and the core, have an option of one name.
    """
    plugins = find()
    refuse_clashes(plugins)
    for plugin in plugins:
        if plugin.source is not None and str(plugin.source) not in sys.path:
            sys.path.append(str(plugin.source))
    if plugins:
        search_also([plugin.conf for plugin in plugins])
        assets.search_also(plugin.assets for plugin in plugins if plugin.assets is not None)
    return plugins


def find() -> tuple[Plugin, ...]:
    """The plugins of `search_folders()`, then the installed ones.

    Of a plugin that is there twice, as a folder and installed, the first counts. Of two plugins
    with one name or one package, the second is left out with a warning.
    """
    accepted: list[Plugin] = []
    dropped_in = tuple(_dropped_in(search_folders()))
    for plugin in (*dropped_in, *_installed({(p.name, p.package) for p in dropped_in})):
        rivals = [p for p in accepted if plugin.name == p.name or plugin.package == p.package]
        if not rivals:
            accepted += _visible(plugin)
        elif (plugin.name, plugin.package) != (rivals[0].name, rivals[0].package):
            same = "name" if plugin.name == rivals[0].name else "package"
            owner = rivals[0].conf.parent
            _leave_out(plugin.conf.parent, f"{owner} has its {same} {getattr(plugin, same)}, too")
    return tuple(accepted)


def _visible(plugin: Plugin) -> Iterator[Plugin]:
    """The plugin, unless Python finds another package of that name first."""
    installed = {entry.value for entry in _entry_points(tuple(sys.path))}
    if plugin.source is not None and plugin.package not in installed:
        spec = importlib.util.find_spec(plugin.package)
        places = [] if spec is None else spec.submodule_search_locations or [str(spec.origin)]
        if places and not any(Path(place).is_relative_to(plugin.source) for place in places):
            reason = f"its package has the name of {places[0]}; rename the package"
            _leave_out(plugin.conf.parent, reason)
            return
    yield plugin


@functools.cache
def _leave_out(plugin: Path | str, reason: str) -> None:
    """Warns, once in a process."""
    _log.warning("plugin %s is left out: %s", plugin, reason)


def search_folders() -> list[Path]:
    """Where plugins are looked for: SCENEFW_PLUGINS, ./plugins and the project's own `plugins`."""
    paths = os.environ.get("SCENEFW_PLUGINS", "").split(os.pathsep)
    listed = [Path(os.path.expanduser(path)) for path in paths if path]  # noqa: PTH111 - no error
    folders = [*listed, Path("plugins"), conf_dir().parent / "plugins"]
    # `resolve` fails on links in a circle
    return list(dict.fromkeys(Path(os.path.realpath(folder)) for folder in folders))


def refuse_clashes(plugins: Sequence[Plugin]) -> None:
    """Raises a ConfigError where an option would silently hide another of the same name."""
    core = conf_dir()
    owners: dict[tuple[str, str], str] = {}
    for plugin in plugins:
        for group, option in plugin.files():
            is_core = (core / group / f"{option}.yaml").exists()
            owner = "the core" if is_core else owners.setdefault((group, option), plugin.name)
            if owner != plugin.name:
                raise ConfigError(
                    f"plugin {plugin.name} brings {group}={option}, a name that {owner} has "
                    f"already; rename {plugin.conf / group / option}.yaml"
                )


def _dropped_in(folders: Sequence[Path]) -> Iterator[Plugin]:
    for folder in folders:
        if any(folder.glob("conf/*/*.yaml")) and not (folder / "plugins").is_dir():
            _leave_out(folder, f"it holds no plugins but is one; give {folder.parent}")
        projects = {path.parent for path in folder.glob("*/pyproject.toml")}
        projects |= {path.parents[2] for path in folder.glob("*/conf/*/*.yaml")}
        for project in sorted(projects):
            yield from _tolerated(project)


def _tolerated(folder: Path) -> Iterator[Plugin]:
    """A broken plugin only causes a warning for those who don't use it."""
    try:
        yield _read(folder)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        _leave_out(folder, " ".join(str(error).split()))


def _read(folder: Path) -> Plugin:
    if not (folder / "pyproject.toml").exists():
        raise ValueError("it has no pyproject.toml, which names its package (docs/plugins.md)")
    project = _toml(folder / "pyproject.toml")
    declared = project.get("project", {}).get("entry-points", {}).get(ENTRY_POINTS)
    if not declared:
        raise ValueError(f'pyproject.toml has no [project.entry-points."{ENTRY_POINTS}"]')
    name, package = next(iter(declared.items()))
    for subfolder in (folder / "src" / package, folder / "conf"):
        if not subfolder.is_dir():
            raise ValueError(
                f"there is no folder {subfolder.relative_to(folder)}{_hint(subfolder)}"
            )
    source = folder / "src"
    return Plugin(name, package, folder / "conf", source, source / package / "assets")


def _toml(file: Path) -> dict[str, Any]:
    try:
        return _parsed(utf8_text(file))
    except (ValueError, RecursionError) as error:  # nested without end
        raise ValueError(f"{file.name}: {str(error) or type(error).__name__}") from error


@functools.cache
def _parsed(text: str) -> dict[str, Any]:
    """What TOML says; plugins are looked for again and again, and parsing takes longest."""
    return tomllib.loads(text)


def _hint(package: Path) -> str:
    """Where a package is whose project has a dash in its name."""
    name = package.name.replace("-", "_")
    if name == package.name or not package.with_name(name).is_dir():
        return ""
    return f'; the package is {name}: give it in [project.entry-points."{ENTRY_POINTS}"]'


@functools.cache
def _entry_points(_path: tuple[str, ...]) -> tuple[metadata.EntryPoint, ...]:
    """What packages on `sys.path` declare; the argument is that, so that a change is noticed."""
    return tuple(metadata.entry_points(group=ENTRY_POINTS))


def _installed(dropped_in: Container[tuple[str, str]]) -> Iterator[Plugin]:
    """Those that packages declare, scenefw's own bundled ones too, but for what is a folder."""
    for entry in _entry_points(tuple(sys.path)):
        if (entry.name, entry.value) in dropped_in:
            continue  # in a checkout its package is importable once the folder is
        try:
            root = package_dir(entry.value)
            yield Plugin(entry.name, entry.value, conf_dir(entry.value), assets=root / "assets")
        except (ConfigError, ValueError, ImportError) as error:
            _leave_out(entry.name, str(error))
