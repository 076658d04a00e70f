import numpy as np
import pytest

from scenefw.core.errors import InputError
from scenefw_serving.scored_masks import ids_of_masks

WIDE = np.array([[1, 1, 1, 0]], dtype=bool)
NARROW = np.array([[0, 1, 0, 0]], dtype=bool)


def test_a_pixel_is_of_the_mask_with_the_highest_score():
    assert ids_of_masks([WIDE, NARROW], [0.5, 0.9]).tolist() == [[1, 2, 1, 0]]
    assert ids_of_masks([WIDE, NARROW], [0.9, 0.5]).tolist() == [[1, 1, 1, 0]]


def test_without_scores_the_smaller_mask_is_on_top():
    assert ids_of_masks([NARROW, WIDE]).tolist() == [[2, 1, 2, 0]]
    assert ids_of_masks([WIDE, NARROW]).tolist() == [[1, 2, 1, 0]]


def test_masks_as_bytes_or_logits_are_read_by_their_sign():
    logits = np.where(NARROW, 3.5, -2.0)
    assert ids_of_masks([logits]).tolist() == [[0, 1, 0, 0]]
    assert ids_of_masks([255 * NARROW.astype(np.uint8)]).tolist() == [[0, 1, 0, 0]]


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
