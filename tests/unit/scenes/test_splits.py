"""Which part of a data set a scene belongs to."""

import numpy as np

from scenefw.scenes.splits import SPLITS, split_of


def test_the_part_depends_on_seed_and_index_alone():
    parts = np.array([split_of(0, i) for i in range(1500)])
    shares = [(parts == name).mean() for name in SPLITS]
    np.testing.assert_allclose(shares, [0.70, 0.15, 0.15, 0.0], atol=0.04)
    assert split_of(0, 17) == parts[17]
    assert (parts != [split_of(1, i) for i in range(1500)]).any()
