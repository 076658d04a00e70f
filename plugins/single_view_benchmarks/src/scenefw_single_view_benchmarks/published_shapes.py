"""Published figures of shapes of whole objects from one image, on other data than ours.

They are quoted from summaries; what their Chamfer distances sum or average was not checked, so they
say in what range others are, not who is better.
"""

from typing import NamedTuple


class PublishedShapes(NamedTuple):
    """A figure of the literature.

    Args:
        method: its name, and how it works in a word or two.
        data: what it was measured on.
        chamfer: distance (m).
    """

    method: str
    data: str
    chamfer: float


ROWS = (
    PublishedShapes("ZeroGrasp (a conditional VAE for each object)", "GraspNet-1B", 0.006),
    PublishedShapes("OctMAE (one surface, no objects)", "YCB-Video", 0.0064),
)
