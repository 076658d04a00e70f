"""Which settings a run reads, so that a setting without effect is an error."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from scenefw import listing, registry
from scenefw.argument_types import as_written
from scenefw.config import conf_dir
from scenefw.core.errors import ConfigError
from scenefw.execution.build import LATER

if TYPE_CHECKING:
    from hydra.core.override_parser.types import Override
    from omegaconf import DictConfig

_REFERENCE = re.compile(r"\$\{(?:oc\.select:|oc\.dict\.keys:)?(\.*)(\w[\w.]*)")
_ALWAYS = ("hydra", "paths", "seed", "device", "threads", "yielding", "deterministic", "profile")
"""Settings of every run, whatever its task."""
_SHOWN = 3


def settings_read(config: DictConfig, key: str = "run") -> frozenset[str]:
    """Keys of all settings that building a node reads, by following references.

    Args:
        config: the whole, as composed.
        key: of the node.

    Returns:
        Full keys such as `run.page` and, where that refers to it, `report.title`.
    """
    read_keys: set[str] = set()
    waiting = [key]
    while waiting:
        waiting += _visit(config, waiting.pop(), read_keys)
    return frozenset(read_keys)


def require_read(
    config: DictConfig,
    overrides: Sequence[str],
    options: Mapping[str, Collection[str]],
    choices: Mapping[str, Any] | None = None,
    keys: Sequence[str] = ("run",),
) -> None:
    """Checks before the work that the run reads everything that the user chose.

    Args:
        config: the whole, as composed.
        overrides: as typed.
        options: names of the options of every group.
        choices: Hydra's record of chosen options, by `group` or `group@place`.
        keys: of the nodes that are built.

    Raises:
        ConfigError: it doesn't read one of them; the line says what it reads in its place.
    """
    from hydra.core.override_parser.overrides_parser import OverridesParser

    read_keys = frozenset[str]().union(*(settings_read(config, key) for key in keys))
    for override in OverridesParser.create().parse_overrides(list(overrides)):
        place = _place(override, options, config)
        if place is not None and not _is_read(place, read_keys):
            choice_parts = [word.partition("@") for word in choices or {}]
            places = [at for group, _, at in choice_parts if group == override.key_or_group and at]
            suggestions = [
                f"{override.key_or_group}@{at}" for at in places if _is_read(at, read_keys)
            ]
            raise ConfigError(
                _complaint(override, place, suggestions or _similar(place, read_keys), config)
            )


def _place(
    override: Override, options: Mapping[str, Collection[str]], config: DictConfig
) -> str | None:
    """The key that an override changes; None if unknown, or if every run has it."""
    from omegaconf import OmegaConf

    name = override.key_or_group
    if name.partition(".")[0] in _ALWAYS or override.is_delete():
        return None
    if name not in options:
        return name.replace("/", ".")
    place = override.package or name
    exists = OmegaConf.select(config, place, throw_on_missing=False) is not None
    return place if exists else None  # experiments and scales change settings everywhere


def _is_read(place: str, read_keys: Collection[str]) -> bool:
    return any(key == place or key.startswith((f"{place}.", f"{place}[")) for key in read_keys)


def _complaint(
    override: Override, place: str, suggestions: Sequence[str], config: DictConfig
) -> str:
    from omegaconf import OmegaConf

    task = str(OmegaConf.select(config, "run._target_")).rpartition(".")[2]
    line = f"{override.input_line} changes nothing: this run ({task}) does not read {place}"
    if not suggestions:
        runs = " or ".join(_verbs_that_read(place))
        choice = f"run={runs}" if runs else "a run"
        return f"{line}; leave it out, or choose {choice} or an option that reads it"
    value = override.get_value_element_as_str()
    return f"{line}; did you mean {' or '.join(f'{key}={value}' for key in suggestions)}?"


def _verbs_that_read(place: str) -> list[str]:
    """Options of `run`, without those of plugins, that name a setting themselves."""
    reference, core = f"${{{place}}}", conf_dir()
    return [name for name, path in sorted(registry.options("run").items())
            if path.is_relative_to(core) and reference in str(listing.composed(path))]  # fmt: skip


def _similar(place: str, read_keys: Collection[str]) -> list[str]:
    """Settings that the run reads with the same last word."""
    leaf = place.rpartition(".")[2]
    matches = sorted(key for key in read_keys if key.rpartition(".")[2] == leaf and "." in place)
    return matches[:_SHOWN]


def _visit(config: DictConfig, key: str, read_keys: set[str]) -> Iterator[str]:
    """Notes a key and those below it; yields the keys that they refer to."""
    from omegaconf import OmegaConf

    if key in read_keys:
        return
    read_keys.add(key)
    parent, _, name = key.rpartition(".")
    holder: Any = OmegaConf.select(config, parent) if parent else config
    if not OmegaConf.is_dict(holder) or name not in holder:
        return
    # The holder may be a reference
    full_key = ".".join(filter(None, [holder._get_full_key(""), name]))
    raw = as_written(holder, name)
    if not isinstance(raw, str) and OmegaConf.is_config(holder[name]):
        raw = OmegaConf.to_container(holder[name], resolve=False, throw_on_missing=False)
    yield from _below(raw, full_key, read_keys)


def _below(raw: Any, key: str, read_keys: set[str]) -> Iterator[str]:
    read_keys.add(key)
    if isinstance(raw, dict):
        for name, value in raw.items():
            if name == LATER:
                yield str(value)
            yield from _below(value, f"{key}.{name}", read_keys)
    elif isinstance(raw, list):
        for value in raw:
            yield from _below(value, key, read_keys)
    elif isinstance(raw, str):
        for dots, target in _REFERENCE.findall(raw):
            yield _absolute(dots, target, key)


def _absolute(dots: str, target: str, key: str) -> str:
    """The full key of a reference at `key`: one dot is a sibling, each further one a level up."""
    if not dots:
        return target
    above = key.split(".")[: -len(dots)]
    return ".".join([*above, target])
