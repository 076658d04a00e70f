"""A family of things: named ranges of what may differ, and how parts follow from the numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from scenefw_things.shapes.solids import Part

Limits = tuple[float, float]
"""Least and greatest value of a parameter: metres, radians, or a ratio without unit."""


Builder = Callable[..., list[Part]]
"""Makes the parts of one thing (m) of a generator, made from its seed, and named parameters."""


@dataclass(frozen=True)
class Family:
    """Things of one kind.

    Args:
        name: as in settings.
        limits: of each parameter, by name.
        build: makes the parts, in its usual attitude.
        hollow: others may be put into it.
        slender: it may be put into what is hollow, or lean.
    """

    name: str
    limits: Mapping[str, Limits]
    build: Builder
    hollow: bool = False
    slender: bool = False


def family(
    *, hollow: bool = False, slender: bool = False, **limits: Limits
) -> Callable[[Builder], Family]:
    """Makes a family of a function and the ranges of its parameters."""

    def made(build: Builder) -> Family:
        return Family(build.__name__, limits, build, hollow, slender)

    return made
