"""Object labels that mean the same in two volumes."""

import itertools

import numpy as np

from scenefw.core.types import Int32
from scenefw.matching.assignment import Assignment
from scenefw.matching.costs import overlaps


def renumbered_like(instances: Int32, reference: Int32) -> Int32:
    """Labels renumbered: an object matched to one of a reference has its label, others new ones.

    Args:
        instances: (X, Y, Z) labels, 0 = no object.
        reference: of the same shape.
    """
    common = overlaps(instances, reference)
    pairs = Assignment().assign(-common.shared.astype(np.float64))
    labels = {
        int(common.predicted[row]): int(common.true[column])
        for row, column in pairs
        if common.shared[row, column] > 0
    }
    unused = itertools.count(int(common.true.max(initial=0)) + 1)
    renumbered = np.zeros_like(instances)
    for i in common.predicted.tolist():
        renumbered[instances == i] = labels[i] if i in labels else next(unused)
    return renumbered
