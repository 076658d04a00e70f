"""What a class promises is held against a protocol without making an instance."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import pytest

from scenefw import core
from scenefw.contracts import PROTOCOLS, problems
from scenefw.core.evidence import Evidence, FittedSuperquadric
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


def test_protocols_are_those_that_the_core_s_source_has():
    """A new module of `core` needs no entry anywhere."""
    written = {
        line.removeprefix("class ").partition("(")[0]
        for path in core.__path__
        for file in Path(path).glob("*.py")
        for line in file.read_text("utf-8").splitlines()
        if re.match(r"class \w+\(.*\bProtocol(\[\w+\])?\):", line)
    }
    assert set(PROTOCOLS) == written
    assert {"Renderer", "ShapeFit"} <= written


class Fits(Protocol):
    def fit(self, evidence: Sequence[Evidence]) -> list[FittedSuperquadric]: ...


class FitsFrames:
    def fit(self, frames: Sequence[Frame]) -> list[FittedSuperquadric]: ...


def test_data_of_every_module_of_the_core_is_compared():
    assert list(problems(FitsFrames, Fits)) == ["takes Frame in fit, not Evidence"]
