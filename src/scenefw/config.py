"""Configs: where they are, how Hydra composes them, and what is wrong with them in one line."""

from __future__ import annotations

import difflib
import functools
import importlib.util
import math
import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenefw.core.errors import ConfigError
from scenefw.renamed_settings import new_name

if TYPE_CHECKING:
    from hydra.core.override_parser.overrides_parser import OverridesParser
    from hydra.core.override_parser.types import Override
    from omegaconf import DictConfig

ROOT_CONFIG = "config"
_ABSENT = re.compile(r"Interpolation key '(\w+)[\w.]*' not found|Key '(\w+)' is not in struct")
_BEFORE_QUOTE = re.compile(r"(\\*)('|\Z)")  # where backslashes count
_AMBIGUOUS = re.compile(r"Ambiguous value for argument '([^=]+)=(.*)'")
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
    """Spares Hydra a map of all choices for each file, made for references between choices.

    Hydra 1.3 makes one even where a file's list of defaults has no such reference: 40 % of the
    time of a composition. What it composes is the same.
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


def explain(
    error: Exception, overrides: Sequence[str], options: Mapping[str, Sequence[str]]
) -> ConfigError:
    """Says in one line which override is wrong and what the user may have meant.

    Args:
        error: what Hydra raised.
        overrides: what the user typed.
        options: names of the options of every group.
    """
    from hydra.core.override_parser.overrides_parser import OverridesParser
    from hydra.errors import HydraException

    parser, parsed = OverridesParser.create(), []
    for text in overrides:
        try:
            parsed.append(parser.parse_override(text))
        except HydraException:
            return ConfigError(f"'{text}' is not understood; {_as_understood(text, parser)}")
    views = any(override.input_line == "run=decompose" for override in parsed)
    complaints = (
        (None if views and override.key_or_group.startswith("run.") else _renamed(override))
        or _unknown_option(override, options)
        for override in parsed
    )
    wrong = next(filter(None, complaints), None) or _unknown_key(parsed, options)
    return ConfigError(wrong or _ambiguous(error) or _unchosen(error, options) or squash(error))


def quoted(text: str) -> str:
    """Any text in the grammar of overrides."""
    escaped = _BEFORE_QUOTE.sub(lambda match: 2 * match[1] + match[2].replace("'", "\\'"), text)
    return f"'{escaped}'"


def _as_understood(text: str, parser: OverridesParser) -> str:
    """The advice for an override that Hydra can't parse, after a message of what is wrong.

    If quotes around the value are all that it lacks, the advice is how to type it so in a shell;
    else it only says what overrides look like.
    """
    from hydra.errors import HydraException

    key, equals, value = text.partition("=")
    word = f"{key}={quoted(value)}"
    try:
        parser.parse_override(word)
    except HydraException:
        equals = ""
    if not equals or value[:1] in ("", "[", "{", "(", "$"):
        return "overrides look like key=value"
    return (
        "a value with other characters than a-z, 0-9 and ._-/ needs quotes of its own: "
        f"{_for_shell(word)}"
    )


def _for_shell(word: str) -> str:
    return shlex.quote(word) if set(word) & set('"$`\\!') else f'"{word}"'


def _ambiguous(error: Exception) -> str | None:
    match = _AMBIGUOUS.search(str(error))
    if match is None:
        return None
    key, value = match[1], match[2]
    return (
        f"{key}={value} has a comma; a value with one needs quotes of its own, "
        f"{_for_shell(f'{key}={quoted(value)}')}, several values are '{key}=[{value}]', and a "
        "sweep over them has -m"
    )


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


def _renamed(override: Override) -> str | None:
    """Says what a setting is called now, if it had another name before."""
    typed = str(override.input_line).lstrip("+~")
    key, _, value = typed.partition("=")
    new = new_name(key, value)
    if new is None:
        return None
    advice = new if "=" in new or not value else f"{new}={value}"
    return f"{typed} has another name now; give {advice}"


def _unknown_option(override: Override, options: Mapping[str, Sequence[str]]) -> str | None:
    group = override.key_or_group
    if group not in options or override.is_delete():
        return None
    if override.value() is None:
        return f"{group}=null names no option; ~{group} leaves the group out"
    for name in _option_names(override):
        if name not in options[group]:
            return f"group {group} has no option '{name}'; {near_misses(name, options[group])}"
    return None


def _unchosen(error: Exception, options: Mapping[str, Sequence[str]]) -> str | None:
    """Asks for an option of a group that is read but has none chosen."""
    match = _ABSENT.search(str(error))
    group = (match[1] or match[2]) if match else ""
    if group not in options:
        return None
    names = ", ".join(options[group])
    return f"no {group} is chosen; give {group}=..., or an experiment that does (there are {names})"


def _option_names(override: Override) -> Iterator[str]:
    value: Any = override.value()
    if override.is_sweep_override():
        values = list(override.sweep_string_iterator())
    else:
        values = value if isinstance(value, list) else [value]
    return (str(v) for v in values if v is not None and not str(v).startswith("["))


def _unknown_key(overrides: Sequence[Override], options: Mapping[str, Sequence[str]]) -> str | None:
    choices = [o for o in overrides if o.key_or_group in options and not o.is_sweep_override()]
    try:
        config = compose([str(o.input_line) for o in choices])
    except ConfigError:
        return None
    keys = sorted({*_keys(config), *options})
    for override in overrides:
        key = override.key_or_group
        if key.startswith("hydra") or override.is_add() or override.is_force_add() or key in keys:
            continue
        return f"there is no key '{key}'; {_near_keys(key, keys)} (+{key}=... adds a new one)"
    return None


def _near_keys(key: str, keys: Sequence[str]) -> str:
    """Asks for keys that end in the same name or are spelled alike; else says how to see all."""
    leaf = key.rpartition(".")[2]
    leaf_matches = [k for k in keys if k.rpartition(".")[2] == leaf]
    shallow = [k for k in keys if k.count(".") <= key.count(".")]
    spelling_matches = difflib.get_close_matches(key, shallow, n=2, cutoff=0.76)
    close = [*difflib.get_close_matches(key, leaf_matches, n=2, cutoff=0.5), *spelling_matches]
    if close:
        return f"did you mean {' or '.join(dict.fromkeys(close))}?"
    return "--cfg job lists all keys"


def _keys(config: DictConfig, prefix: str = "") -> Iterator[str]:
    from omegaconf import DictConfig, OmegaConf

    for key in map(str, config):
        yield f"{prefix}{key}"
        if OmegaConf.is_missing(config, key) or OmegaConf.is_interpolation(config, key):
            continue
        value = config[key]
        if isinstance(value, DictConfig):
            yield from _keys(value, f"{prefix}{key}.")
