"""Sections of real masks with references."""

from dataclasses import replace

import numpy as np
import pytest

from scenefw.report.presentation import Chapter
from scenefw_single_view_benchmarks.labelled_masks import (
    Failure,
    ImageResult,
    LabelledMaskResult,
    Scored,
)
from scenefw_single_view_benchmarks.mask_scores import MaskScores
from scenefw_single_view_benchmarks.seams import Seams

sections = Chapter("scenefw_single_view_benchmarks.report").sections
GOOD = MaskScores(0.9, 0.8, 0.85, 0.7, 0.6, 0.65, 1.0, 2, 2)
POOR = replace(GOOD, overlap_f=0.5, objects_f75=0.0, predicted=4)


def _image(name, scores):
    labels = dict.fromkeys(("true", "method", "reference"), np.zeros((4, 4), np.int16))
    return ImageResult(name, scores, POOR, labels)


def test_masks_beside_reference_and_published(tmp_path):
    images = (_image("a", GOOD), _image("b", POOR))
    failures = (Failure("c", "no floor", 5), Failure("d", "damaged", None))
    section, gallery = sections(
        LabelledMaskResult(images, failures, "Seen from above.", published=True), tmp_path
    )
    table, spread, failure, damaged = section.blocks
    ours, reference, published = (cells for _, cells in table.rows[:3])
    assert ours[0] == pytest.approx(33.75)  # per cent, mean of 0.85, 0.5 and twice 0
    assert ours[-1] == pytest.approx(7 / 3)  # objects per image: 0, 2 and 5
    assert reference[0] == pytest.approx(25)
    assert published[0] == pytest.approx(83.3)
    assert published[-1] is None
    names = [name for name, _ in table.rows]
    assert names[2] == "UOIS-Net-3D: depth, masks refined with colour (published)"
    assert table.quoted == set(names[2:])
    assert "4 images, of which 2 failed and count as 0" in table.note
    assert "but for 1, whose labels" in table.note
    assert "learns nothing. Seen from above. Published: Xie et al. 2021" in table.note
    assert spread.rows[0][1][0] == pytest.approx(85)
    assert spread.rows[-1][1] == (0, 0, 0, 0)
    assert "d: damaged" in damaged.text
    assert "c: no floor" in failure.text
    assert [block.path for block in gallery.blocks] == [
        f"gallery/{word}.jpg" for word in ("best", "median", "worst")
    ]
    assert all((tmp_path / block.path).is_file() for block in gallery.blocks)
    assert not any(block.shareable for block in gallery.blocks)  # of somebody's data


def test_masks_without_failures_speak_of_none(tmp_path):
    section, _ = sections(LabelledMaskResult((_image("a", GOOD), _image("b", POOR))), tmp_path)
    table, spread = section.blocks
    assert dict(table.rows)["set extents"][0] == pytest.approx(67.5)
    assert table.note.startswith("Percent, means over 2 images; count error")
    assert "Published" not in table.note
    assert not table.quoted
    assert spread.rows[-1][1][0] == pytest.approx(50)


def test_masks_at_other_heights_of_the_floor(tmp_path):
    margins = {
        0.002: {"scores": Scored(GOOD, Seams(1, 2, 1, 2)), "reference": Scored(POOR, Seams())},
        0.008: {"scores": Scored(POOR, Seams(1, 1, 1, 1)), "reference": Scored(GOOD, Seams())},
    }
    images = [replace(_image(name, GOOD), margins=margins) for name in "ab"]
    section, _ = sections(LabelledMaskResult(tuple(images)), tmp_path)
    table = section.blocks[1]
    headings = [column.name for column in table.columns]
    assert headings[:3] == ["overlap F", "reference overlap F", "boundary F"]
    rows = dict(table.rows)
    assert list(rows) == ["up to 2 mm", "up to 8 mm"]
    assert rows["up to 2 mm"] == pytest.approx((85, 50, 65, 65, 50, 100))
    assert rows["up to 8 mm"] == pytest.approx((50, 85, 65, 65, 100, 100))
