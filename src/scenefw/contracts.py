"""Whether a class satisfies a protocol, as far as can be checked without an instance."""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import re
import textwrap
from collections.abc import Iterator
from dataclasses import is_dataclass
from functools import cache
from typing import Any

from scenefw import core

_NAME = re.compile(r"[A-Za-z_]\w*")


def _classes_of_core() -> Iterator[tuple[str, type]]:
    """Every class that a module of `core` defines, so that a new module is known by being there."""
    for found in pkgutil.iter_modules(core.__path__, f"{core.__name__}."):
        module = importlib.import_module(found.name)
        for name, value in vars(module).items():
            if inspect.isclass(value) and value.__module__ == module.__name__:
                yield name, value


_CLASSES = dict(_classes_of_core())
PROTOCOLS = {name: one for name, one in _CLASSES.items() if one.__dict__.get("_is_protocol")}
"""The protocols of `core` by name."""

_CROSSING = frozenset(name for name, one in _CLASSES.items() if is_dataclass(one))
"""Data that crosses floors: its classes are final, so one never stands for another."""


def protocol_named(name: str) -> type:
    """A protocol of `core` by its name, or any other by its dotted path.

    Raises:
        AttributeError, ImportError: there is none.
    """
    if "." in name:
        return _protocol(pkgutil.resolve_name(name), name)
    return _protocol(PROTOCOLS.get(name), name)


def _protocol(found: Any, name: str) -> type:
    if not getattr(found, "_is_protocol", False):
        raise AttributeError(f"{name} is not a protocol")
    checked: type = found
    return checked


def problems(found: type, protocol: type) -> Iterator[str]:
    """What a class lacks or does differently from a protocol, each in a few words.

    Compares methods, how many arguments they take, the types of `core` that they take and
    give, and attributes that the class or its `__init__` sets.
    """
    yield from wrong_methods(found, protocol)
    yield from (f"has no attribute {name}" for name in _missing_attributes(found, protocol))


def wrong_methods(found: type, protocol: type) -> Iterator[str]:
    """As `problems`, but only for methods."""
    for name, promised in methods(protocol).items():
        own = getattr(found, name, None)
        if own is None:
            yield f"has no {name}"
        elif callable(own) and inspect.isfunction(inspect.unwrap(own)):
            yield from _wrong_signature(name, inspect.signature(own), inspect.signature(promised))


def methods(protocol: type) -> dict[str, Any]:
    """The public methods, and `__call__`, that a protocol and those it extends promise."""
    members: dict[str, Any] = {}
    for base in reversed(_protocols(protocol)):
        members |= {n: v for n, v in vars(base).items() if inspect.isfunction(v)}
    hidden = ("_abc", "__init__", "__subclasshook__", "__class_getitem__")
    public = (n for n in members if not n.startswith("_") or n in ("__call__", "__len__"))
    return {n: members[n] for n in public if n not in hidden}


def attributes(protocol: type) -> frozenset[str]:
    """Names of attributes and properties that a protocol and those it extends promise."""
    found: set[str] = set()
    for base in _protocols(protocol):
        found |= set(inspect.get_annotations(base))
        found |= {n for n, v in vars(base).items() if isinstance(v, property)}
    return frozenset(name for name in found if not name.startswith("_"))


def _protocols(protocol: type) -> list[type]:
    return [base for base in protocol.__mro__ if base.__dict__.get("_is_protocol", False)]


def _missing_attributes(found: type, protocol: type) -> list[str]:
    there: set[str] = set()
    for base in found.__mro__:
        there |= set(vars(base)) | set(inspect.get_annotations(base)) | _set_by_init(base)
    return sorted(attributes(protocol) - there)


@cache
def _set_by_init(found: type) -> frozenset[str]:
    """Attributes that `__init__` sets on `self`."""
    init = vars(found).get("__init__")
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(init)))  # type: ignore[arg-type]
    except (OSError, TypeError, SyntaxError):
        return frozenset()
    stores = (n for n in ast.walk(tree) if isinstance(n, ast.Attribute))
    return frozenset(n.attr for n in stores if isinstance(n.ctx, ast.Store))


def _wrong_signature(
    name: str, own: inspect.Signature, promised: inspect.Signature
) -> Iterator[str]:
    theirs = list(promised.parameters.values())[1:]
    try:
        bound = own.bind(
            None,
            *(p for p in theirs if p.kind is p.POSITIONAL_OR_KEYWORD),
            **{p.name: p for p in theirs if p.kind is p.KEYWORD_ONLY},
        ).arguments
    except TypeError as error:
        yield f"has another {name}: {error}"
        return
    pairs = ((own.parameters[n], given) for n, given in list(bound.items())[1:])
    for mine, given in pairs:
        if isinstance(given, inspect.Parameter):
            taken, handed = _types(mine.annotation), _types(given.annotation)
            if taken and handed and not handed <= taken:
                yield f"takes {_listed(taken)} in {name}, not {_listed(handed - taken)}"
    made, wanted = _types(own.return_annotation), _types(promised.return_annotation)
    if made and wanted and not made <= wanted:
        yield f"gives {_listed(made)} from {name}, not {_listed(wanted)}"


def _types(annotation: Any) -> frozenset[str]:
    """Types of `core` in an annotation; none where it says Any, or nothing."""
    if annotation is inspect.Parameter.empty:
        return frozenset()
    words = set(_NAME.findall(annotation if isinstance(annotation, str) else str(annotation)))
    words |= {annotation.__name__} if isinstance(annotation, type) else set()
    return frozenset() if {"Any", "object"} & words else frozenset(words & _CROSSING)


def _listed(names: frozenset[str]) -> str:
    return " or ".join(sorted(names))
