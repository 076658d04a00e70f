"""Pictures of a labelled map as frames arrive (figure 4.21)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenefw.report.labelling.pictures import (
    TILE,
    Picture,
    label_picture,
    resized,
    shaded,
    source_names,
    source_picture,
)
from scenefw.report.palette import class_colours
from scenefw.report.pictures import beside, legend, stacked
from scenefw_labelling_studies.results import Example

_RIGHT, _WRONG, _MISSED = (0.93, 0.93, 0.92), (0.80, 0.15, 0.12), (0.35, 0.35, 0.40)


def example_picture(example: Example, classes: Sequence[str], strategies: Sequence[str]) -> Picture:
    """RGB: a column per number of frames; rows of colour, labels, errors and sources."""
    tiles: list[Picture] = []
    titles: list[str] = []
    for frames in example.frames:
        tiles.append(shaded(example.colour[frames], np.any(example.colour[frames], axis=-1)))
        titles.append(f"colour, {frames} frames")
    tiles.append(shaded(example.true_colour, np.ones(example.truth.shape, np.bool_)))
    titles.append("colour, true")
    for strategy in strategies:
        for frames in example.frames:
            tiles.append(label_picture(example.labels[strategy, frames], len(classes)))
            titles.append(strategy)
        tiles.append(label_picture(example.truth, len(classes)))
        titles.append("true labels")
        for frames in example.frames:
            tiles.append(error_picture(example.labels[strategy, frames], example.truth))
            titles.append(f"{strategy}, errors")
        tiles.append(np.ones_like(tiles[-1]))
        titles.append("")
    if example.sources:
        for frames in example.frames:
            tiles.append(source_picture(example.sources[frames]))
            titles.append("hybrid, labels come from")
    tiles = [resized(tile, TILE) for tile in tiles]
    sheet = beside(tiles, titles, columns=len(example.frames) + 1)
    names = dict(zip(classes, class_colours(len(classes)), strict=True))
    marks = {"wrong": _WRONG, "unknown": _MISSED} | source_names()
    return stacked(sheet, legend(names | marks, sheet.shape[1]))


def error_picture(labels: NDArray[Any], truth: NDArray[Any]) -> Picture:
    """RGB (H, W, 3): wrong labels red, missing ones dark, right ones light."""
    palette = np.array([_RIGHT, _WRONG, _MISSED], np.float32)
    kind = np.where(labels < 0, 2, labels != truth)
    return palette[np.where(truth < 0, 0, kind)]
