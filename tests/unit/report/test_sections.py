"""Sections of results: real masks with references beside them, and results of any other kind."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from scenefw.evaluation.real_masks import ImageResult, RealMaskResult
from scenefw.metrics.masks import MaskScores
from scenefw.report.sections import sections
from scenefw.report.tables import Table

GOOD = MaskScores(0.9, 0.8, 0.85, 0.7, 0.6, 0.65, 1.0, 2, 2)
POOR = replace(GOOD, overlap_f=0.5, objects_f75=0.0, predicted=4)


def _image(name, scores):
    labels = dict.fromkeys(("true", "method", "reference"), np.zeros((4, 4), np.int16))
    return ImageResult(name, scores, POOR, labels)


def test_masks_beside_reference_and_published():
    images = (_image("a", GOOD), _image("b", POOR))
    (section,) = sections(RealMaskResult(images, (("c", "no floor"),)))
    table, spread, failure = section.blocks
    ours, reference, published = (cells for _, cells in table.rows)
    assert ours[0] == pytest.approx(67.5)  # per cent, mean of 0.85 and 0.5
    assert ours[-1] == pytest.approx(1.0)  # objects per image
    assert reference[0] == pytest.approx(50)
    assert published[0] == pytest.approx(83.3)
    assert published[-1] is None
    assert "2 images; 1 more" in table.note
    assert spread.rows[0][1][0] == pytest.approx(85)
    assert spread.rows[-1][1][0] == pytest.approx(50)
    assert "c: no floor" in failure.text


def test_any_result_with_figures():
    (section,) = sections(SimpleNamespace(figures={"some_figure": 0.25}))
    (table,) = section.blocks
    assert isinstance(table, Table)
    assert table.rows == (("some_figure", (0.25,)),)
