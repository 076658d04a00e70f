import numpy as np

from scenefw.matching.instances import renumbered_like


def test_labels_follow_the_reference():
    true = np.zeros((4, 4, 4), np.int32)
    true[:2], true[2:] = 1, 2
    predicted = np.zeros_like(true)
    predicted[:1], predicted[1:2], predicted[2:] = 9, 4, 5
    found = renumbered_like(predicted, true)
    assert (found[2:] == 2).all()
    assert sorted(np.unique(found[:2])) == [1, 3]  # one half is object 1, the other is no true one
    assert not renumbered_like(np.zeros_like(true), true).any()
    assert renumbered_like(predicted, np.zeros_like(true)).max() == 3
