"""Results that are kept as long as what they were computed of."""

from __future__ import annotations

from functools import wraps
from typing import TYPE_CHECKING, TypeVar
from weakref import WeakKeyDictionary

if TYPE_CHECKING:
    from collections.abc import Callable

Item = TypeVar("Item")
Result = TypeVar("Result")


def cached_by_identity(function: Callable[[Item], Result]) -> Callable[[Item], Result]:
    """A function of one object that computes its result once per object.

    The object must never change, must be equal to itself alone, and must not be held by the result:
    a result that holds it would keep both for ever.
    """
    results: WeakKeyDictionary[Item, Result] = WeakKeyDictionary()

    @wraps(function)
    def cached(item: Item) -> Result:
        result = results.get(item)
        if result is None:
            results[item] = result = function(item)
        return result

    return cached
