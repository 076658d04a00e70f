"""Mappings whose items are computed when they are first asked for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

Key = TypeVar("Key")
Item = TypeVar("Item")


class LazyMapping(Mapping[Key, Item]):
    """Items of some keys, each computed once, and only if somebody asks for it.

    Args:
        keys: in the order of the mapping.
        compute: the item of a key.
    """

    def __init__(self, keys: Iterable[Key], compute: Callable[[Key], Item]) -> None:
        self._keys, self._compute = dict.fromkeys(keys), compute
        self._items: dict[Key, Item] = {}

    def __getitem__(self, key: Key) -> Item:
        if key not in self._items:
            if key not in self._keys:
                raise KeyError(key)
            self._items[key] = self._compute(key)
        return self._items[key]

    def __contains__(self, key: object) -> bool:
        return key in self._keys

    def __iter__(self) -> Iterator[Key]:
        return iter(self._keys)

    def __len__(self) -> int:
        return len(self._keys)
