"""Configs: where they are, how Hydra composes them, and what is wrong with them in one line."""

from __future__ import annotations

import difflib
import functools
import importlib.util
import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import FunctionType
from typing import TYPE_CHECKING, Any, cast

from scenefw.core.errors import ConfigError

if TYPE_CHECKING:
    from omegaconf import DictConfig

ROOT_CONFIG = "config"
_BEFORE_QUOTE = re.compile(r"(\\*)('|\Z)")  # where backslashes count
_search_path: list[Path] = []  # folders of plugins, read whenever Hydra starts


def conf_dir(package: str = "scenefw") -> Path:
    """The folder of a package's configs: the copy packed into it, else `conf` beside its `src`.

    Raises:
        ConfigError: the package isn't installed or brings no configs.
    """
    root = package_dir(package)
    for folder in (root / "conf", root.parent.parent / "conf"):
        if folder.is_dir():
            return folder
    raise ConfigError(f"package {package} has no folder conf, neither in {root} nor beside its src")


def files_in(conf: Path) -> Iterator[tuple[str, str, Path]]:
    """Group, name and file of everything in a folder of configs; `thesis/simstack` is a name."""
    for path in sorted(conf.glob("*/**/*.yaml")):
        group, *parts = path.relative_to(conf).with_suffix("").parts
        yield group, "/".join(parts), path


def is_option(name: str) -> bool:
    """Whether it can be chosen: what begins with _ is shared by options, or describes a group."""
    return not any(part.startswith("_") for part in name.split("/"))


def package_dir(package: str) -> Path:
    """The folder of an installed package, which is not imported.

    Raises:
        ConfigError: it isn't installed.
    """
    spec = importlib.util.find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        raise ConfigError(f"package {package} is not installed; its configs can't be found")
    return Path(next(iter(spec.submodule_search_locations)))


def search_also(folders: Sequence[Path]) -> None:
    """Makes Hydra look for options in these folders after the core's own."""
    from hydra.core.config_search_path import ConfigSearchPath
    from hydra.core.plugins import Plugins
    from hydra.plugins.search_path_plugin import SearchPathPlugin

    class PluginConfigs(SearchPathPlugin):
        def manipulate_search_path(self, search_path: ConfigSearchPath) -> None:
            for folder in _search_path:
                search_path.append(provider=folder.parent.name, path=f"file://{folder}")

    if not _search_path and folders:
        Plugins.instance().register(PluginConfigs)
    _search_path.extend(folder for folder in folders if folder not in _search_path)


def folders_searched() -> list[Path]:
    """Where Hydra looks for options."""
    return [conf_dir(), *_search_path]


def compose(overrides: Sequence[str] = ()) -> DictConfig:
    """The whole config with these command-line overrides; for tests, notebooks and the registry.

    Raises:
        ConfigError: an option or a key doesn't exist, or a value doesn't parse.
    """
    import hydra
    import yaml
    from hydra.core.global_hydra import GlobalHydra
    from hydra.errors import HydraException
    from omegaconf.errors import OmegaConfBaseException

    compose_lean()
    know_choices()
    running = GlobalHydra.instance().hydra  # Hydra composes one config at a time
    GlobalHydra.instance().clear()
    try:
        with hydra.initialize_config_dir(str(conf_dir()), job_name="scenefw", version_base="1.3"):
            return hydra.compose(ROOT_CONFIG, list(overrides))
    except (HydraException, OmegaConfBaseException, ValueError, yaml.YAMLError) as error:
        raise ConfigError(squash(error)) from error
    finally:
        GlobalHydra.instance().hydra = running


def compose_once(words: Sequence[str], folders: Sequence[Path]) -> None:
    """Spares Hydra a composition of everything for `hydra.mode` alone where nobody sets that.

    Hydra 1.3 composes all settings to learn whether a config asks for a sweep, then once more to
    run: a third of the time until a command begins to work.

    Args:
        words: the command line.
        folders: of configs, the core's and plugins'.
    """
    from hydra._internal.hydra import Hydra

    compose_lean()
    know_choices()
    files = (path for folder in folders for path in folder.rglob("*.yaml"))
    texts = (path.read_text(encoding="utf-8", errors="replace") for path in files)
    sets_mode = any("hydra.mode" in word for word in words) or any(
        "MULTIRUN" in text for text in texts
    )
    if not sets_mode:
        Hydra.get_mode = lambda *_, **__: None  # type: ignore[method-assign]


def compose_lean() -> None:
    """Spares Hydra work that doesn't change what it composes: two thirds of the time."""
    _map_choices_on_demand()
    _tell_parents_once()
    _parse_once()


def _map_choices_on_demand() -> None:
    """No map of all choices for each file without references between choices.

    Hydra 1.3 makes one even where a file's list of defaults has no such reference.
    """
    from hydra._internal import defaults_list
    from omegaconf import OmegaConf

    complete: Any = vars(defaults_list).get("_create_interpolation_map")
    if complete is None or "__wrapped__" in vars(complete):
        return  # another Hydra, or done before

    @functools.wraps(complete)
    def lean(overrides: Any, defaults: list[Any], self_added: bool) -> Any:
        if any(entry.is_interpolation() for entry in defaults):
            return complete(overrides, defaults, self_added)
        return OmegaConf.create({})

    vars(defaults_list)["_create_interpolation_map"] = lean


def _tell_parents_once() -> None:
    """Settings learn their parent where they are merged, not once more on every level above.

    OmegaConf 2.3 walks through all settings below a merged one, and Hydra merges a hundred files
    and more into one. Those further below were merged, or moved as a whole, and have their parents.
    """
    from omegaconf.base import Box, Node
    from omegaconf.basecontainer import BaseContainer

    if "_re_parent" not in vars(Box) or "_re_parent" in vars(BaseContainer):
        return  # another OmegaConf, or done before

    def tell(merged: Box) -> None:
        content = merged.__dict__["_content"]
        nodes = content.values() if isinstance(content, dict) else content
        for node in nodes if isinstance(content, dict | list) else ():
            if isinstance(node, Node):
                node._set_parent(merged)

    BaseContainer._re_parent = cast("Any", tell)  # type: ignore[method-assign]


def _parse_once() -> None:
    """References between settings are parsed once each.

    OmegaConf 2.3 parses one whenever it is read: 1660 times for the 110 of a prediction.
    """
    from omegaconf import _utils, base

    for module in (_utils, base):
        parse = vars(module).get("parse")
        if isinstance(parse, FunctionType):  # neither another OmegaConf, nor done before
            vars(module)["parse"] = functools.lru_cache(maxsize=None)(parse)


def know_choices() -> None:
    """Lets settings say `${chosen:GROUP}`: the option of a group that a run has chosen.

    It is null where Hydra runs nothing, as in `compose`.
    """
    from hydra.core.hydra_config import HydraConfig
    from omegaconf import OmegaConf

    def chosen_option(group: str) -> str | None:
        if not HydraConfig.initialized():
            return None
        option = HydraConfig.get().runtime.choices.get(group)
        return None if option is None else str(option)

    OmegaConf.register_new_resolver("chosen", chosen_option, replace=True)


def near_misses(name: str, names: Sequence[str]) -> str:
    """Asks what the user may have meant, or lists what there is if nothing is similar."""
    close = difflib.get_close_matches(name, names, n=3, cutoff=0.6)
    if close:
        return "did you mean " + " or ".join(close) + "?"
    return "there are " + ", ".join(sorted(names)) if names else "there are none"


def quoted(text: str) -> str:
    """Any text in the grammar of overrides."""
    escaped = _BEFORE_QUOTE.sub(lambda match: 2 * match[1] + match[2].replace("'", "\\'"), text)
    return f"'{escaped}'"


def runs_of_sweep(words: Sequence[str]) -> int:
    """How many runs a command line asks for with `-m`: the product of the numbers of values."""
    from hydra.core.override_parser.overrides_parser import OverridesParser

    overrides = [word for word in words if not word.startswith("-")]
    counts = [
        len(list(override.sweep_string_iterator()))
        for override in OverridesParser.create().parse_overrides(overrides)
        if override.is_sweep_override()
    ]
    return math.prod(counts)


def squash(error: BaseException) -> str:
    """The message of an error, and of what caused it, as one line."""
    parts = [" ".join(str(error).split())]
    if error.__cause__ is not None and str(error.__cause__) not in str(error):
        parts.append(" ".join(str(error.__cause__).split()))
    return ": ".join(part for part in parts if part) or type(error).__name__
