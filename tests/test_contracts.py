"""What a class promises is held against a protocol without making an instance."""

from collections.abc import Sequence
from typing import Any, Protocol

import pytest

from scenefw.contracts import problems
from scenefw.core.types import Camera, Frame, Scene


class Base(Protocol):
    size: int


class Promise(Base, Protocol):
    classes: Sequence[str]

    def look(self, frame: Frame, times: int = 1) -> Scene | None: ...

    def turn(self, *, fast: bool) -> None: ...


class Good:
    size = 3

    def __init__(self):
        self.classes = ("a",)

    def look(self, image: "Frame | Camera", times: int = 2, more: int = 0) -> Scene: ...

    def turn(self, *, fast: bool = True, far: bool = False) -> None: ...


class WithProperty(Good):
    @property
    def size(self): ...


class Untyped(Good):
    def look(self, *anything, **more): ...


class Unknown(Good):
    def look(self, frame: Any, times: int) -> Any: ...


@pytest.mark.parametrize("kept", [Good, WithProperty, Untyped, Unknown])
def test_a_class_that_keeps_it_has_no_problem(kept):
    assert list(problems(kept, Promise)) == []


class NoMethod(Good):
    look = None


class TakesLess(Good):
    def look(self, frame: Frame) -> Scene: ...


class NeedsMore(Good):
    def turn(self, *, fast: bool, far: bool) -> None: ...


class TakesOther(Good):
    def look(self, frame: Camera, times: int = 1) -> Scene: ...


class GivesOther(Good):
    def look(self, frame: Frame, times: int = 1) -> Camera: ...


class NoAttribute:
    size = 1
    look, turn = Good.look, Good.turn

    def __init__(self):
        self.others = self.classes  # reads it, but never sets it


@pytest.mark.parametrize(
    ("broken", "words"),
    [
        (NoMethod, "has no look"),
        (TakesLess, "has another look: too many positional arguments"),
        (NeedsMore, "has another turn: missing a required argument: 'far'"),
        (TakesOther, "takes Camera in look, not Frame"),
        (GivesOther, "gives Camera from look, not Scene"),
        (NoAttribute, "has no attribute classes"),
    ],
)
def test_what_is_broken_is_said(broken, words):
    assert list(problems(broken, Promise)) == [words]
