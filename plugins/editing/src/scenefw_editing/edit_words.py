"""Edits of scenes as words: `move 1 0.1 0 0`."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

from scenefw.core.errors import InputError
from scenefw_editing import scene_editing

if TYPE_CHECKING:
    from collections.abc import Callable

    from scenefw.core.types import SceneEstimate
    from scenefw_editing.scene_editing import Objects

    Read = Callable[[str], SceneEstimate]

USAGES = {
    "remove": "remove ID",
    "move": "move ID DX DY DZ",
    "turn": "turn ID DEGREES [X Y Z]",
    "scale": "scale ID FACTOR",
    "swap": "swap ID ID",
    "add": ("add [FILE] ID [DX DY DZ], or add superquadric A1 A2 A3 R S T X Y [Z [DEGREES]]"),
    "join": "join FILE [DX DY DZ]",
}
"""What can be done; lengths in metres, FILE another scene.json, [...] may be left out."""


def edited(objects: Objects, words: str, read_scene: Read) -> Objects:
    """The objects after one edit.

    Args:
        objects: of the scene.
        words: as in `USAGES`.
        read_scene: gives the scene of a file.

    Raises:
        InputError: the words make no sense, or there is no such object or file.
    """
    try:
        name, *arguments = shlex.split(words)
    except ValueError:
        name, arguments = "", []
    if name not in USAGES:
        matches = get_close_matches(name, USAGES, 1)
        fix = f"did you mean {matches[0]}?" if matches else f"give one of {', '.join(USAGES)}"
        raise InputError(f"there is no edit '{words}'; {fix}")
    try:
        return _EDITS[name](objects, _Words(tuple(arguments)), read_scene)
    except _MisfitError as error:
        raise InputError(f"edit '{words}': expected {USAGES[name]}") from error
    except InputError as error:
        raise InputError(f"edit '{words}': {error}") from error


class _MisfitError(Exception):
    """Too many words, too few, or one that is no number."""


@dataclass(frozen=True)
class _Words:
    """What follows the name of an edit."""

    arguments: tuple[str, ...]

    def sized(self, *counts: int) -> _Words:
        """The same, of one of these lengths."""
        if len(self.arguments) not in counts:
            raise _MisfitError
        return self

    def id(self, place: int) -> int:
        return int(self._number(self.arguments[place], int))

    def numbers(self, start: int, stop: int | None = None) -> list[float]:
        return [self._number(word, float) for word in self.arguments[start:stop]]

    @staticmethod
    def _number(word: str, kind: Any) -> float:
        try:
            return float(kind(word))
        except ValueError as error:
            raise _MisfitError from error


def _remove(objects: Objects, words: _Words, read_scene: Read) -> Objects:
    return scene_editing.removed(objects, words.sized(1).id(0))


def _move(objects: Objects, words: _Words, read_scene: Read) -> Objects:
    return scene_editing.moved_by(objects, words.sized(4).id(0), words.numbers(1))


def _turn(objects: Objects, words: _Words, read_scene: Read) -> Objects:
    label, (degrees, *axis) = words.sized(2, 5).id(0), words.numbers(1)
    return scene_editing.moved_by(objects, label, turn=degrees, axis=axis or (0.0, 0.0, 1.0))


def _scale(objects: Objects, words: _Words, read_scene: Read) -> Objects:
    return scene_editing.scaled(objects, words.sized(2).id(0), words.numbers(1)[0])


def _swap(objects: Objects, words: _Words, read_scene: Read) -> Objects:
    return scene_editing.swapped(objects, words.sized(2).id(0), words.id(1))


def _add(objects: Objects, words: _Words, read_scene: Read) -> Objects:
    if words.arguments[:1] == ("superquadric",):
        numbers = _Words(words.arguments[1:]).sized(8, 9, 10).numbers(0)
        place = [*numbers[6:9], None][:3]
        turn = numbers[9] if len(numbers) > 9 else 0.0
        shape = scene_editing.superquadric(numbers[:3], numbers[3:6], place, turn)
        return scene_editing.added(objects, shape)
    if len(words.arguments) in (1, 4):  # of this scene
        return _add_copy(objects, objects, words)
    words.sized(2, 5)
    return _add_copy(objects, read_scene(words.arguments[0]).objects, _Words(words.arguments[1:]))


def _add_copy(objects: Objects, source: Objects, words: _Words) -> Objects:
    item = scene_editing.named(source, words.id(0))
    return scene_editing.added(objects, item, words.numbers(1) or (0.0, 0.0, 0.0))


def _join(objects: Objects, words: _Words, read_scene: Read) -> Objects:
    by = words.sized(1, 4).numbers(1) or (0.0, 0.0, 0.0)
    return scene_editing.joined(objects, read_scene(words.arguments[0]).objects, by)


_EDITS: dict[str, Callable[[Objects, _Words, Read], Objects]] = {
    "remove": _remove,
    "move": _move,
    "turn": _turn,
    "scale": _scale,
    "swap": _swap,
    "add": _add,
    "join": _join,
}
