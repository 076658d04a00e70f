import numpy as np
import pytest

from scenefw.core.errors import InputError
from scenefw_serving.scored_masks import ids_of_masks

WIDE = np.array([[1, 1, 1, 0]], dtype=bool)
NARROW = np.array([[0, 1, 0, 0]], dtype=bool)


def ids(masks, scores=None):
    return ids_of_masks(masks, scores)[0].tolist()


def test_a_pixel_is_of_the_mask_with_the_highest_score():
    assert ids([WIDE, NARROW], [0.5, 0.9]) == [[1, 2, 1, 0]]
    assert ids([WIDE, NARROW], [0.9, 0.5]) == [[1, 1, 1, 0]]


def test_without_scores_the_smaller_mask_is_on_top():
    assert ids([NARROW, WIDE]) == [[2, 1, 2, 0]]
    assert ids([WIDE, NARROW]) == [[1, 2, 1, 0]]


def test_masks_are_of_one_value():
    for mask in (NARROW, 255 * NARROW.astype(np.uint8), NARROW.astype(float)):
        assert ids([mask]) == [[0, 1, 0, 0]]


@pytest.mark.parametrize(
    "mask",
    [
        np.where(NARROW, 0.9, 0.03),
        np.where(NARROW, 3.5, -2.0),
        np.where(NARROW, 1.0, np.nan),
        np.array([[0, 255, 120, 0]], np.uint8),
    ],
)
def test_soft_masks_are_refused(mask):
    with pytest.raises(InputError, match=r"mask 2 has several values, .* threshold it"):
        ids_of_masks([WIDE.astype(mask.dtype), mask])


def test_masks_without_pixels_are_told():
    image, notes = ids_of_masks([WIDE, NARROW, 0 * WIDE, NARROW], [1, 2, 3, 2])
    assert image.tolist() == [[1, 4, 1, 0]]
    assert notes == (
        "object 2 of the masks is left out: other masks have all of its pixels",
        "object 3 of the masks is left out: its mask holds no pixel",
    )


@pytest.mark.parametrize(
    ("masks", "scores", "words"),
    [
        (WIDE, None, "(N, H, W)"),
        (np.zeros((0, 2, 2), bool), None, "(N, H, W)"),
        ([WIDE, NARROW], [1.0], "2 numbers"),
        ([WIDE], [np.nan], "NaN"),
        ([WIDE], ["a"], "numbers"),
    ],
)
def test_what_are_no_masks_or_scores_is_said(masks, scores, words):
    with pytest.raises(InputError) as said:
        ids_of_masks(masks, scores)
    assert words in str(said.value)
