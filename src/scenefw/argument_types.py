"""Checks the values of a config against the argument types of components."""

from __future__ import annotations

import ast
import inspect
import re
from typing import TYPE_CHECKING, Any, NamedTuple

from scenefw.contracts import PROTOCOLS, wrong_methods
from scenefw.core.dotted_names import resolve
from scenefw.core.errors import ConfigError
from scenefw.core.typed_values import as_typed

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from omegaconf import DictConfig

_REFERENCE = re.compile(r"\$\{(?:oc\.select:)?(\w[\w.]*)(?:,.*)?\}")
_SEQUENCE = re.compile(r"(?:Sequence|tuple|list)\[(.*)\]")
_MAPPING = re.compile(r"Mapping\[str, ([\w.]+)\]")
_OURS = ("scenefw.", "scenefw_")  # packages of the core and of bundled plugins
_WORDS = {
    "float": "a number",
    "int": "a whole number",
    "bool": "true or false",
    "str": "text",
    "Path": "a path",
    "None": "null",
}


class _Part(NamedTuple):
    """A component that one argument takes, by its protocol or class; several by name."""

    protocol: type
    several: bool


class _Argument(NamedTuple):
    """What one argument takes: kinds of `_WORDS`, of its elements if it is a sequence."""

    kinds: frozenset[str]
    sequence: bool
    default: Any


class PartError(ConfigError):
    """A plain value where a part is expected.

    Args:
        setting: its key.
        value: as typed.
        kind: of the part.
    """

    def __init__(self, setting: str, value: str, kind: str) -> None:
        super().__init__(f"{setting} is {value}; expected a part ({kind})")
        self.setting = setting


def check_types(config: DictConfig, key: str) -> None:
    """Checks before the work that values and parts are what components expect.

    Numbers, true or false, text, and sequences of these are checked, and whether parts have the
    methods of the protocols they stand for, with arguments and results of the same types. All
    else is left to the components, as are those that can't be imported.

    Args:
        config: the whole, as composed.
        key: of the part that is to be built, such as `run`.

    Raises:
        ConfigError: a value is of another kind, or a part lacks a method; the line names the
            setting that it comes from.
    """
    for setting, value, argument in _values(config, key, set()):
        if isinstance(argument, _Part):
            if isinstance(value, int | float | str):
                raise PartError(setting, as_typed(value), argument.protocol.__name__)
            _require_methods(setting, value, argument)
        elif not _fits(value, argument):
            raise ConfigError(
                f"{setting} is {as_typed(value)}; expected {_expectation(argument)}"
                + _quotes(setting, value, argument)
            )


def _require_methods(setting: str, node: Any, part: _Part) -> None:
    """Checks only classes: what functions return is not known in advance."""
    from omegaconf import DictConfig

    if not isinstance(node, DictConfig):
        return
    if part.several and "_target_" not in node:
        for name, child in node.items():
            _require_methods(f"{setting}.{name!s}", child, part._replace(several=False))
        return
    built = None if node.get("_partial_") else _imported(node.get("_target_"))
    if not inspect.isclass(built) or not _is_protocol(part.protocol):
        return
    wrong = next(wrong_methods(built, part.protocol), None)
    if wrong is not None:
        raise ConfigError(
            f"{setting} is a {built.__name__}, which {wrong}; expected a {part.protocol.__name__}: "
            f"another option of {setting.partition('.')[0]} (--list shows them)"
        )


def _values(
    config: DictConfig, key: str, visited_keys: set[str]
) -> Iterator[tuple[str, Any, _Argument | _Part]]:
    """Settings, values and arguments of a node and of all that it refers to, each node once."""
    from omegaconf import DictConfig, ListConfig, OmegaConf

    node: Any = OmegaConf.select(config, key)
    if key in visited_keys or not isinstance(node, DictConfig | ListConfig):
        return
    visited_keys.add(key)
    arguments = _arguments(node.get("_target_")) if isinstance(node, DictConfig) else {}
    for name in list(node) if isinstance(node, DictConfig) else range(len(node)):
        if OmegaConf.is_missing(node, name):
            continue
        setting = _origin(config, f"{key}.{name}", as_written(node, name))
        value, argument = node[name], arguments.get(str(name))
        if argument is None and isinstance(value, int | float | str):
            argument = _part_for_types(node, str(name))
        if isinstance(argument, _Argument) and isinstance(value, DictConfig | ListConfig):
            value = OmegaConf.to_container(value, resolve=True)
        if argument is not None:
            yield setting, value, argument
        yield from _values(config, setting, visited_keys)


def _origin(config: DictConfig, setting: str, raw: Any) -> str:
    """The setting that a reference finally leads to."""
    from omegaconf import OmegaConf

    while isinstance(raw, str) and (match := _REFERENCE.fullmatch(raw)):
        parent, _, name = match[1].rpartition(".")
        holder: Any = OmegaConf.select(config, parent) if parent else config
        if not OmegaConf.is_dict(holder) or name not in holder:
            break  # the default of oc.select
        setting, raw = match[1], as_written(holder, name)
    return setting


def as_written(holder: Any, name: Any) -> Any:
    """A value of a node, a reference unresolved; `to_container` would make all that lies below."""
    node = holder._get_node(name)
    return None if node is None else node._value()


def _arguments(target: Any) -> Mapping[str, _Argument | _Part]:
    """Arguments by name, only of known kinds."""
    built = _imported(target)
    if built is None:
        return {}
    names = {**PROTOCOLS, **getattr(inspect.getmodule(built), "__dict__", {})}
    arguments: dict[str, _Argument | _Part] = {}
    for name, parameter in inspect.signature(built).parameters.items():
        plain = _argument(parameter.annotation, parameter.default)
        argument = plain or _part(parameter.annotation, names)
        if argument is not None:
            arguments[name] = argument
    return arguments


def _imported(target: Any) -> Any:
    """The class or function of a target, None if there is none with a signature."""
    if not isinstance(target, str):
        return None
    try:
        built = resolve(target)
        inspect.signature(built)
    except (Exception, SystemExit):  # noqa: BLE001 - whatever an import raises, building it says it better
        return None
    return built


def _argument(annotation: Any, default: Any) -> _Argument | None:
    parts = _annotation_text(annotation).split(" | ")
    inner = [match[1] for part in parts if (match := _SEQUENCE.fullmatch(part))]
    kinds = {part for part in parts if not _SEQUENCE.fullmatch(part)}
    if inner and kinds <= {"None"}:
        kinds |= {word for part in inner for word in part.split(", ") if word != "..."}
    elif inner:
        return None
    default_value = None if default is inspect.Parameter.empty else default
    return _Argument(frozenset(kinds), bool(inner), default_value) if kinds <= set(_WORDS) else None


def _part(annotation: Any, names: Mapping[str, Any]) -> _Part | None:
    """The protocol or class of ours that an annotation names, alone or in a mapping."""
    words = [word for word in _annotation_text(annotation).split(" | ") if word != "None"]
    match = _MAPPING.fullmatch(words[0]) if len(words) == 1 else None
    text = match[1] if match else words[0] if len(words) == 1 else ""
    name = text.partition("[")[0].rpartition(".")[2]  # of a generic one without its parameters
    protocol: Any = names.get(name)
    ours = inspect.isclass(protocol) and protocol.__module__.startswith(_OURS)
    if not (_is_protocol(protocol) or ours):
        return None
    return _Part(protocol, match is not None)


def _part_for_types(node: Any, name: str) -> _Part | None:
    """As `_part`, of an annotation whose class the module imports for type checkers alone."""
    from omegaconf import DictConfig

    built = _imported(node.get("_target_")) if isinstance(node, DictConfig) else None
    parameter = None if built is None else inspect.signature(built).parameters.get(name)
    if parameter is None:
        return None
    words = re.findall(r"\w+", _annotation_text(parameter.annotation))
    names = {
        alias.asname or alias.name: _imported(f"{statement.module}.{alias.name}")
        for statement in _imports_for_types(inspect.getmodule(built))
        if str(statement.module).startswith(_OURS)
        for alias in statement.names
        if (alias.asname or alias.name) in words
    }
    return _part(parameter.annotation, names)


def _imports_for_types(module: Any) -> Iterator[ast.ImportFrom]:
    """Statements `from ... import ...` below `if TYPE_CHECKING:`."""
    try:
        body = ast.parse(inspect.getsource(module)).body
    except (OSError, TypeError, SyntaxError):  # no module, or without its source
        return
    for block in body:
        if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING":
            yield from (part for part in block.body if isinstance(part, ast.ImportFrom))


def _is_protocol(candidate: Any) -> bool:
    return bool(getattr(candidate, "_is_protocol", False))


def _annotation_text(annotation: Any) -> str:
    """An annotation as written, whether or not it has been evaluated."""
    if isinstance(annotation, type) and not hasattr(annotation, "__args__"):
        return annotation.__name__
    text = str(annotation)
    for module in ("collections.abc.", "typing.", "pathlib."):
        text = text.replace(module, "")
    return text


def _fits(value: Any, argument: _Argument) -> bool:
    if argument.sequence and value is not None:
        inner = _Argument(argument.kinds - {"None"}, False, None)
        return isinstance(value, list) and all(_fits(element, inner) for element in value)
    if value is None:
        return "None" in argument.kinds
    if isinstance(value, bool):
        return "bool" in argument.kinds
    words = argument.kinds & {"str", "Path"}
    if isinstance(value, int | float) and "Path" not in words:  # as a name, 007 would be lost
        numbers = {"int", "float"} if isinstance(value, int) else {"float"}
        return bool(argument.kinds & (numbers | words))
    return isinstance(value, str) and bool(words)


def _expectation(argument: _Argument) -> str:
    kinds = argument.kinds - {"str"} if "Path" in argument.kinds else argument.kinds
    words = [word for kind, word in _WORDS.items() if kind in kinds]
    if argument.sequence and argument.default:
        return f"a list such as {as_typed(list(argument.default))}"
    if argument.sequence:
        return "a list of " + ("words" if "str" in argument.kinds else "numbers")
    example = argument.default
    numeric = isinstance(example, int | float) and not isinstance(example, bool)
    return " or ".join(words) + (f", such as {example}" if numeric else "")


def _quotes(setting: str, value: Any, argument: _Argument) -> str:
    if "Path" not in argument.kinds or not isinstance(value, int | float):
        return ""
    return f"; a name like this needs quotes: \"{setting}='{as_typed(value)}'\""
