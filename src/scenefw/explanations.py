"""What is wrong with the settings that somebody typed, in one line, and what to type instead."""

from __future__ import annotations

import difflib
import re
import shlex
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenefw.config import compose, files_in, folders_searched, near_misses, quoted, squash
from scenefw.core.errors import ConfigError
from scenefw.core.files import utf8_text
from scenefw.renamed_settings import instead_of, new_name

if TYPE_CHECKING:
    from hydra.core.override_parser.overrides_parser import OverridesParser
    from hydra.core.override_parser.types import Override
    from omegaconf import DictConfig

_ABSENT = re.compile(r"Interpolation key '(\w+)[\w.]*' not found|Key '(\w+)' is not in struct")
_AMBIGUOUS = re.compile(r"Ambiguous value for argument '([^=]+)=(.*)'")


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
        _renamed(override, views) or _unknown_option(override, options) for override in parsed
    )
    wrong = next(filter(None, complaints), None) or _wrong_key(parsed, options)
    reasons = (_ambiguous(error), _unchosen(error, options), _undecodable(error))
    return ConfigError(wrong or next(filter(None, reasons), None) or squash(error))


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


def _renamed(override: Override, views: bool) -> str | None:
    """Says what a setting is called now, if it had another name before."""
    typed = str(override.input_line).lstrip("+~")
    key, _, value = typed.partition("=")
    new = new_name(key, value, views=views)
    instead = instead_of(new or key, value)  # what was renamed may be gone by now
    if instead is not None:
        return f"{typed} was deleted; give {instead}"
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


def _undecodable(error: BaseException) -> str | None:
    """Names the option that is not written in UTF-8, which Hydra doesn't."""
    if isinstance(error, UnicodeDecodeError):
        files = (path for conf in folders_searched() for _, _, path in files_in(conf))
        return next(filter(None, map(_encoding_fault, files)), None)
    cause = error.__cause__ or error.__context__
    return None if cause is None else _undecodable(cause)


def _encoding_fault(path: Path) -> str | None:
    try:
        utf8_text(path)
    except ValueError as error:
        return f"{path}: {error}"
    return None


def _option_names(override: Override) -> Iterator[str]:
    value: Any = override.value()
    if override.is_sweep_override():
        values = list(override.sweep_string_iterator())
    else:
        values = value if isinstance(value, list) else [value]
    return (str(v) for v in values if v is not None and not str(v).startswith("["))


def _wrong_key(overrides: Sequence[Override], options: Mapping[str, Sequence[str]]) -> str | None:
    try:
        config = compose(_choices(overrides, options))
    except ConfigError:
        return None
    keys = sorted({*_keys(config), *options})
    for override in overrides:
        key = override.key_or_group
        if key.startswith("hydra") or override.is_add() or override.is_force_add():
            continue
        if key not in keys:
            return f"there is no key '{key}'; {_near_keys(key, keys)} (+{key}=... adds a new one)"
        plain = not override.is_delete() and isinstance(override.value(), int | float | str)
        if key not in options and plain and (place := _place_of_part(key, config)):
            return f"{override.input_line} replaces a part; {_as_part(place)}"
    return None


def settings_of_part(
    key: str, overrides: Sequence[str], options: Mapping[str, Collection[str]]
) -> str:
    """Says how to set what is in a part, for which somebody has typed a plain value.

    Args:
        key: of the part.
        overrides: what the user typed.
        options: names of the options of every group.
    """
    from hydra.core.override_parser.overrides_parser import OverridesParser

    parsed = OverridesParser.create().parse_overrides(list(overrides))
    return _as_part(_place_of_part(key, compose(_choices(parsed, options))) or key)


def _as_part(place: str) -> str:
    return f"leave it out, and give its settings as {place}.NAME=..."


def _choices(overrides: Sequence[Override], options: Mapping[str, Collection[str]]) -> list[str]:
    choices = (o for o in overrides if o.key_or_group in options and not o.is_sweep_override())
    return [str(choice.input_line) for choice in choices]


def _place_of_part(key: str, config: DictConfig) -> str | None:
    """Where a part is defined, not where it is referenced; None if it is none."""
    from omegaconf import DictConfig, OmegaConf

    part: Any = OmegaConf.select(config, key, throw_on_missing=False)
    return part._get_full_key("") or key if isinstance(part, DictConfig) else None


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
