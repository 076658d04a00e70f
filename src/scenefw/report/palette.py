"""Colours of instances; people with any colour vision can distinguish the first six."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenefw.core.types import SceneEstimate

Colour = tuple[float, float, float]

# Okabe and Ito (2008) without black and yellow, which shading swallows; then Tol's muted scheme;
# then of Kelly (1965) and Trubetskoy (2017) those farthest from all before and from light grey.
_HEX = (
    "#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00",
    "#882255", "#999933", "#332288", "#ddcc77", "#44aa99", "#aa4499",
    "#654522", "#e6194b", "#fabebe", "#e6beff", "#800000", "#f032e6",
    "#008080", "#f99379", "#9a6324", "#3cb44b", "#604e97", "#b3446c",
)  # fmt: skip


def instance_colours(number: int) -> list[Colour]:
    """Red, green, blue in [0, 1] of instances 1..number; they repeat after 24."""
    return [_rgb(_HEX[index % len(_HEX)]) for index in range(number)]


def colours_of(scene: SceneEstimate) -> list[Colour]:
    """Of the objects of a scene, in their order; an id has the same colour in all scenes."""
    return [_rgb(_HEX[(item.id - 1) % len(_HEX)]) for item in scene.objects]


def class_colours(number: int) -> list[Colour]:
    """Red, green, blue in [0, 1] of classes 0..number - 1: the surface light grey, then objects."""
    return [(0.85, 0.85, 0.83), *instance_colours(max(number - 1, 0))][:number]


def _rgb(text: str) -> Colour:
    red, green, blue = (int(text[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue
