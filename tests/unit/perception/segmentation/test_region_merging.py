"""Joining regions: against a search through all pixels, at several sizes, and by what it weighs."""

import numpy as np
import pytest

from scenefw.core.errors import ConfigError
from scenefw.perception.segmentation.region_merging import RegionMerging


def joined_anew(merging, regions, across, down, parts):
    """The same, with everything measured anew, pixel by pixel, after each pair."""
    regions = regions.copy()
    while True:
        borders = {}
        for v, u in np.ndindex(regions.shape):
            for (y, x), values in (((v, u + 1), across), ((v + 1, u), down)):
                if y < regions.shape[0] and x < regions.shape[1]:
                    pair = tuple(sorted((int(regions[v, u]), int(regions[y, x]))))
                    if pair[0] and pair[0] != pair[1]:
                        borders.setdefault(pair, []).append(values[v, u])

        def odds(pair, borders=borders):
            masks = [regions == label for label in pair]
            first, second = (np.bincount(parts[mask]).argmax() for mask in masks)
            return (
                merging.intercept
                + merging.affinity * np.mean(borders[pair])
                + merging.same_part * (first == second)
                + merging.log_pixels * np.log(min(mask.sum() for mask in masks))
            )

        best = max(borders, key=odds, default=None)
        if best is None or odds(best) <= 0:
            return regions
        regions[regions == best[1]] = best[0]


@pytest.mark.parametrize("shape", [(9, 12), (16, 7), (18, 24)])
@pytest.mark.parametrize("seed", [0, 1])
def test_regions_are_joined_in_the_order_of_their_odds(shape, seed):
    rng = np.random.default_rng(seed)
    regions = rng.integers(0, 8, (shape[0] // 3 + 1, shape[1] // 3 + 1)).repeat(3, 0).repeat(3, 1)
    regions = regions[: shape[0], : shape[1]].astype(np.int32)
    parts = (regions > 3).astype(np.int32)
    across = rng.uniform(-3, 3, (shape[0], shape[1] - 1))
    down = rng.uniform(-3, 3, (shape[0] - 1, shape[1]))
    merging = RegionMerging(intercept=1.3, affinity=0.8, same_part=0.5, log_pixels=-0.5)
    labels = merging.merged(regions, across, down, parts)
    expected = joined_anew(merging, regions, across, down, parts)
    pairs = np.unique(np.stack([labels.ravel(), expected.ravel()]), axis=1)
    assert pairs.shape[1] == len(np.unique(expected)) == len(np.unique(labels))
    assert 1 < len(np.unique(expected)) < len(np.unique(regions))
    never = RegionMerging(intercept=-99.0)
    np.testing.assert_array_equal(never.merged(regions, across, down, parts), regions)


@pytest.mark.parametrize("size", [4, 12])
def test_each_measure_decides_where_the_others_are_even(size):
    regions = np.repeat([1, 1, 2, 2], size)[None].repeat(size, axis=0).astype(np.int32)
    halves = (regions > 1).astype(np.int32)
    down = np.full((size - 1, 4 * size), 4.6)

    def number(log_odds, parts, **weights):
        merging = RegionMerging(**{"affinity": 0.0, "same_part": 0.0, "log_pixels": 0.0} | weights)
        across = np.full((size, 4 * size - 1), log_odds)
        return len(np.unique(merging.merged(regions, across, down, parts)))

    nothing = np.zeros_like(regions)
    assert number(-1.1, nothing, intercept=1.0, affinity=1.0) == 2
    assert number(-0.9, nothing, intercept=1.0, affinity=1.0) == 1
    assert number(0.0, halves, intercept=-1.0, same_part=2.0) == 2
    assert number(0.0, nothing, intercept=-1.0, same_part=2.0) == 1
    log = np.log(2 * size**2)
    assert number(0.0, nothing, intercept=log - 0.1, log_pixels=-1.0) == 2
    assert number(0.0, nothing, intercept=log + 0.1, log_pixels=-1.0) == 1


def test_an_image_without_regions_stays_so():
    nothing = np.zeros((5, 6), np.int32)
    across, down = np.ones((5, 5), np.float32), np.ones((4, 6), np.float32)
    assert not RegionMerging().merged(nothing, across, down, nothing).any()


@pytest.mark.parametrize(
    "wrong", [{"creases": None}, {"intercept": np.nan}, {"same_part": np.inf}, {"affinity": np.nan}]
)
def test_bad_settings(wrong):
    with pytest.raises(ConfigError, match=f"^{next(iter(wrong))} "):
        RegionMerging(**wrong)
