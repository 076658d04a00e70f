"""What components were made with, as plain data: it names what is kept of their work.

A component says so by its public attributes, those that don't begin with `_`. Whatever changes a
result belongs into one of them; what is only remembered (an engine's world, a cache) does not.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Mapping
from functools import cached_property
from pathlib import PurePath
from typing import Any, Protocol, runtime_checkable

PLAIN = (bool, int, float, str, type(None))


@runtime_checkable
class _Array(Protocol):
    """A number, an array or a tensor of a library."""

    def tolist(self) -> Any: ...


def settings_of(component: Any) -> Any:
    """Class and public attributes of a component and of its parts, as JSON types.

    Arrays become lists, paths become text, functions and classes their dotted names.
    """
    if isinstance(component, PLAIN):
        return component
    if isinstance(component, _Array):
        return component.tolist()
    if isinstance(component, (list, tuple)):
        return [settings_of(value) for value in component]
    if isinstance(component, Mapping):
        return {str(name): settings_of(value) for name, value in component.items()}
    if isinstance(component, PurePath):
        return str(component)
    if inspect.isroutine(component) or inspect.isclass(component):
        return f"{component.__module__}.{component.__qualname__}"
    kind = type(component)
    attributes = {name: settings_of(value) for name, value in sorted(public(component).items())}
    return {"_target_": f"{kind.__module__}.{kind.__qualname__}", **attributes}


def public(component: object) -> dict[str, Any]:
    """Public attributes by name, in the order in which they were set; no cached properties."""
    if dataclasses.is_dataclass(component):
        names = [field.name for field in dataclasses.fields(component)]  # may have slots
    else:
        names = list(vars(component))
    computed = {n for c in type(component).__mro__ for n, v in vars(c).items() if _is_cached(v)}
    return {
        name: getattr(component, name)
        for name in names
        if not name.startswith("_") and name not in computed
    }


def _is_cached(member: object) -> bool:
    return isinstance(member, cached_property)
