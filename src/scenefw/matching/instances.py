"""Object labels that mean the same in two volumes."""

import itertools

import numpy as np

from scenefw.core.types import Int32
from scenefw.matching.assignment import Assignment


def renumbered_like(instances: Int32, reference: Int32) -> Int32:
    """Labels renumbered: an object matched to one of a reference has its label, others new ones.

    Args:
        instances: (X, Y, Z) labels, 0 = no object.
        reference: of the same shape.
    """
    labelled = (instances > 0) | (reference > 0)  # most of a volume is neither
    ids, rows = np.unique(instances[labelled], return_inverse=True)
    truths, columns = np.unique(reference[labelled], return_inverse=True)
    places = rows.ravel() * len(truths) + columns.ravel()
    counts = np.bincount(places, minlength=len(ids) * len(truths)).reshape(len(ids), len(truths))
    overlap = counts[ids > 0][:, truths > 0]
    ids, truths = ids[ids > 0], truths[truths > 0]
    labels: dict[int, int] = {}
    if overlap.size:
        pairs = Assignment().assign(-overlap.astype(np.float64))
        labels = {int(ids[r]): int(truths[c]) for r, c in pairs if overlap[r, c] > 0}
    unused = itertools.count(int(truths.max(initial=0)) + 1)
    renumbered = np.zeros_like(instances)
    for i in ids.tolist():
        renumbered[instances == i] = labels[i] if i in labels else next(unused)
    return renumbered
