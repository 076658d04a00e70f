"""Whether the values of a config are of the kinds that components say they take."""

from __future__ import annotations

import inspect
import re
from typing import TYPE_CHECKING, Any, NamedTuple

from scenefw.core.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from omegaconf import DictConfig

_REFERENCE = re.compile(r"\$\{(?:oc\.select:)?(\w[\w.]*)(?:,.*)?\}")
_SEQUENCE = re.compile(r"(?:Sequence|tuple|list)\[(.*)\]")
_WORDS = {
    "float": "a number",
    "int": "a whole number",
    "bool": "true or false",
    "str": "text",
    "None": "null",
}


class _Argument(NamedTuple):
    """What one argument takes: kinds of `_WORDS`, of its elements if it is a sequence."""

    kinds: frozenset[str]
    sequence: bool
    default: Any


def check_types(config: DictConfig, key: str) -> None:
    """Finds out before the work whether numbers are where components expect numbers.

    Arguments of other types than numbers, true or false, text, and sequences of these are left to
    the components, as are components that can't be imported.

    Args:
        config: the whole, as composed.
        key: of the part that is to be built, such as `run`.

    Raises:
        ConfigError: a value is of another kind; the line names the setting that it comes from.
    """
    for setting, value, argument in _values(config, key, set()):
        if not _fits(value, argument):
            raise ConfigError(f"{setting} is {_shown(value)}; expected {_expectation(argument)}")


def _values(config: DictConfig, key: str, seen: set[str]) -> Iterator[tuple[str, Any, _Argument]]:
    """Settings, values and arguments of a node and of all that it refers to, each node once."""
    from omegaconf import DictConfig, ListConfig, OmegaConf

    node: Any = OmegaConf.select(config, key)
    if key in seen or not isinstance(node, DictConfig | ListConfig):
        return
    seen.add(key)
    raw: Any = OmegaConf.to_container(node, resolve=False)
    arguments = _arguments(node.get("_target_")) if isinstance(node, DictConfig) else {}
    for name, written in raw.items() if isinstance(raw, dict) else enumerate(raw):
        if OmegaConf.is_missing(node, name):
            continue
        setting = _origin(config, f"{key}.{name}", written)
        value, argument = node[name], arguments.get(str(name))
        if argument is not None:
            plain = isinstance(value, DictConfig | ListConfig)
            yield setting, OmegaConf.to_container(value, resolve=True) if plain else value, argument
        yield from _values(config, setting, seen)


def _origin(config: DictConfig, setting: str, written: Any) -> str:
    """Where a value is set that was written as a reference to another setting."""
    from omegaconf import OmegaConf

    while isinstance(written, str) and (found := _REFERENCE.fullmatch(written)):
        parent, _, name = found[1].rpartition(".")
        holder: Any = OmegaConf.select(config, parent) if parent else config
        if not OmegaConf.is_dict(holder) or name not in holder:
            break  # the default of oc.select
        raw: Any = OmegaConf.to_container(holder, resolve=False)
        setting, written = found[1], raw[name]
    return setting


def _arguments(target: Any) -> Mapping[str, _Argument]:
    """Arguments by name, of those kinds alone that are known."""
    from hydra.utils import get_object

    if not isinstance(target, str):
        return {}
    try:
        parameters = inspect.signature(get_object(target)).parameters
    except Exception:  # noqa: BLE001 - whatever an import may raise, building it says it better
        return {}
    found = {name: _argument(p.annotation, p.default) for name, p in parameters.items()}
    return {name: argument for name, argument in found.items() if argument is not None}


def _argument(annotation: Any, default: Any) -> _Argument | None:
    if isinstance(annotation, type) and not hasattr(annotation, "__args__"):
        annotation = annotation.__name__
    parts = str(annotation).replace("collections.abc.", "").split(" | ")
    inner = [found[1] for part in parts if (found := _SEQUENCE.fullmatch(part))]
    kinds = {part for part in parts if not _SEQUENCE.fullmatch(part)}
    if inner and kinds <= {"None"}:
        kinds |= {word for part in inner for word in part.split(", ") if word != "..."}
    elif inner:
        return None
    known = None if default is inspect.Parameter.empty else default
    return _Argument(frozenset(kinds), bool(inner), known) if kinds <= set(_WORDS) else None


def _fits(value: Any, argument: _Argument) -> bool:
    if argument.sequence and value is not None:
        inner = _Argument(argument.kinds - {"None"}, False, None)
        return isinstance(value, list) and all(_fits(each, inner) for each in value)
    if value is None:
        return "None" in argument.kinds
    if isinstance(value, bool):
        return "bool" in argument.kinds
    if isinstance(value, int):
        return bool(argument.kinds & {"int", "float", "str"})
    if isinstance(value, float):
        return bool(argument.kinds & {"float", "str"})
    return isinstance(value, str) and "str" in argument.kinds


def _expectation(argument: _Argument) -> str:
    words = [word for kind, word in _WORDS.items() if kind in argument.kinds]
    if argument.sequence and argument.default:
        return f"a list such as {_shown(list(argument.default))}"
    if argument.sequence:
        return "a list of " + ("words" if "str" in argument.kinds else "numbers")
    example = argument.default
    numeric = isinstance(example, int | float) and not isinstance(example, bool)
    return " or ".join(words) + (f", such as {example}" if numeric else "")


def _shown(value: Any) -> str:
    """As it is typed."""
    if isinstance(value, list):
        return f"[{', '.join(map(_shown, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    return "null" if value is None else str(value)
