"""Tables 6.1 and 6.2 of the thesis, to print beside our figures.

Source: "Scene Understanding for 3D Multi-Object Scenes: Labelling, Reasoning and Decomposing", PhD
thesis, Imperial College London, Department of Computing. It doesn't define its errors: ours are
those of `metrics.decomposition`. Its networks are trained on 8062 scenes of 6 and on 10 765 of 4 to
8 objects, and it doesn't say what its cross entropy is a mean over; ours is over voxels and
predictions.
"""

from typing import NamedTuple


class PublishedDecomposition(NamedTuple):
    """A row of a published table.

    Args:
        words: data and input.
        table: where it stands.
        scenes: test scenes.
        cross_entropy: mean binary cross entropy (nats).
        missing_or_joined: share of scenes with a missing or a joined object.
        duplicate_or_split: the same of duplicated or split ones; None = not given.
    """

    words: str
    table: str
    scenes: int
    cross_entropy: float
    missing_or_joined: float
    duplicate_or_split: float | None


ROWS = {
    "of_six": PublishedDecomposition("6 objects, from occupancy", "6.1", 82, 0.0014, 0.024, None),
    "of_four_to_eight": PublishedDecomposition(
        "4 to 8 objects, from occupancy", "6.1", 95, 0.0021, 0.052, 0.345
    ),
    "from_view": PublishedDecomposition(
        "4 to 8 objects, from one view", "6.2", 95, 0.0020, 0.108, 0.178
    ),
}
"""By what is decomposed."""
