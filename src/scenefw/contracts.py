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
    for info in pkgutil.iter_modules(core.__path__, f"{core.__name__}."):
        module = importlib.import_module(info.name)
        for name, value in vars(module).items():
            if inspect.isclass(value) and value.__module__ == module.__name__:
                yield name, value


_CLASSES = dict(_classes_of_core())
PROTOCOLS = {name: cls for name, cls in _CLASSES.items() if cls.__dict__.get("_is_protocol")}
"""The protocols of `core` by name."""

_CROSSING = frozenset(name for name, cls in _CLASSES.items() if is_dataclass(cls))
"""Data that crosses floors: its classes are final, so one never stands for another."""


def protocol_named(name: str) -> type:
    """A protocol of `core` by its name, or any other by its dotted path.

    Raises:
        AttributeError, ImportError: there is none.
    """
    if "." in name:
        return _protocol(pkgutil.resolve_name(name), name)
    return _protocol(PROTOCOLS.get(name), name)


def _protocol(candidate: Any, name: str) -> type:
    if not getattr(candidate, "_is_protocol", False):
        raise AttributeError(f"{name} is not a protocol")
    protocol: type = candidate
    return protocol


def problems(cls: type, protocol: type) -> Iterator[str]:
    """What a class lacks or does differently from a protocol, each in a few words.

    Compares methods, how many arguments they take, the types of `core` that they take and
    give, and attributes that the class or its `__init__` sets.
    """
    yield from wrong_methods(cls, protocol)
    yield from (f"has no attribute {name}" for name in _missing_attributes(cls, protocol))


def wrong_methods(cls: type, protocol: type) -> Iterator[str]:
    """As `problems`, but only for methods."""
    for name, promised in methods(protocol).items():
        method = getattr(cls, name, None)
        if method is None:
            yield f"has no {name}"
        elif callable(method) and inspect.isfunction(inspect.unwrap(method)):
            yield from _wrong_signature(
                name, inspect.signature(method), inspect.signature(promised)
            )


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
    names: set[str] = set()
    for base in _protocols(protocol):
        names |= set(inspect.get_annotations(base))
        names |= {n for n, v in vars(base).items() if isinstance(v, property)}
    return frozenset(name for name in names if not name.startswith("_"))


def _protocols(protocol: type) -> list[type]:
    return [base for base in protocol.__mro__ if base.__dict__.get("_is_protocol", False)]


def _missing_attributes(cls: type, protocol: type) -> list[str]:
    names: set[str] = set()
    for base in cls.__mro__:
        names |= set(vars(base)) | set(inspect.get_annotations(base)) | _set_by_init(base)
    return sorted(attributes(protocol) - names)


@cache
def _set_by_init(cls: type) -> frozenset[str]:
    """Attributes that `__init__` sets on `self`."""
    init = vars(cls).get("__init__")
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(init)))  # type: ignore[arg-type]
    except (OSError, TypeError, SyntaxError):
        return frozenset()
    stores = (n for n in ast.walk(tree) if isinstance(n, ast.Attribute))
    return frozenset(n.attr for n in stores if isinstance(n.ctx, ast.Store))


def _wrong_signature(
    name: str, signature: inspect.Signature, promised: inspect.Signature
) -> Iterator[str]:
    theirs = list(promised.parameters.values())[1:]
    try:
        bound = signature.bind(
            None,
            *(p for p in theirs if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)),
            **{p.name: p for p in theirs if p.kind is p.KEYWORD_ONLY},
        ).arguments
    except TypeError as error:
        yield f"has another {name}: {error}"
        return
    pairs = ((signature.parameters[n], argument) for n, argument in list(bound.items())[1:])
    for parameter, argument in pairs:
        if isinstance(argument, inspect.Parameter):
            parameter_types = _types(parameter.annotation)
            argument_types = _types(argument.annotation)
            if parameter_types and argument_types and not argument_types <= parameter_types:
                excess = _listed(argument_types - parameter_types)
                yield f"takes {_listed(parameter_types)} in {name}, not {excess}"
    return_types = _types(signature.return_annotation)
    promised_types = _types(promised.return_annotation)
    if return_types and promised_types and not return_types <= promised_types:
        yield f"gives {_listed(return_types)} from {name}, not {_listed(promised_types)}"


def _types(annotation: Any) -> frozenset[str]:
    """Types of `core` in an annotation; none where it says Any, or nothing."""
    if annotation is inspect.Parameter.empty:
        return frozenset()
    words = set(_NAME.findall(annotation if isinstance(annotation, str) else str(annotation)))
    words |= {annotation.__name__} if isinstance(annotation, type) else set()
    return frozenset() if {"Any", "object"} & words else frozenset(words & _CROSSING)


def _listed(names: frozenset[str]) -> str:
    return " or ".join(sorted(names))
