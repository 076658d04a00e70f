"""What rebuilds a network: its class and its arguments as plain data."""

import inspect
from collections.abc import Mapping, Sequence
from typing import Any


def recipe_of(network: object, arguments: Mapping[str, Any]) -> dict[str, Any]:
    """The recipe of a network, as files of weights hold it.

    Args:
        network: of any class.
        arguments: of its constructor by name, such as `locals()` there; all else is left out.
    """
    kind = type(network)
    recipe: dict[str, Any] = {"_target_": f"{kind.__module__}.{kind.__qualname__}"}
    for name in inspect.signature(kind).parameters:
        value = arguments[name]
        is_list = isinstance(value, Sequence) and not isinstance(value, str)
        recipe[name] = list(value) if is_list else value
    return recipe
