"""Components of depth images against plain breadth-first search."""

from collections import deque

import numpy as np
import pytest

from scenefw.perception.observation.components import depth_parts


def searched(depth, among, jump):
    labels = np.zeros(depth.shape, int)
    for start in zip(*np.nonzero(among), strict=True):
        if labels[start]:
            continue
        labels[start] = labels.max() + 1
        queue = deque([start])
        while queue:
            y, x = queue.popleft()
            for near in ((y + 1, x), (y - 1, x), (y, x + 1), (y, x - 1)):
                inside = 0 <= near[0] < depth.shape[0] and 0 <= near[1] < depth.shape[1]
                if not inside or not among[near] or labels[near]:
                    continue
                if abs(depth[near] - depth[y, x]) < jump:
                    labels[near] = labels[start]
                    queue.append(near)
    return labels


@pytest.mark.parametrize("shape", [(12, 17), (31, 23)])
def test_parts_are_those_of_a_search(shape):
    rng = np.random.default_rng(0)
    depth = rng.choice([1.0, 1.004, 1.02], shape).astype(np.float32)
    among = rng.random(shape) < 0.8
    found, expected = depth_parts(depth, among, 0.01), searched(depth, among, 0.01)
    pairs = np.unique(np.stack([found[among], expected[among]]), axis=1)
    assert pairs.shape[1] == expected.max() == found.max()  # the same parts, however numbered
    assert (found[~among] == 0).all()
