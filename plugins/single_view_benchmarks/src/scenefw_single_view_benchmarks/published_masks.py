"""Published scores of instance masks on the Object Segmentation Database (OSD).

All are of table II of Xie et al., "Unseen Object Instance Segmentation for Robotic Environments",
IEEE Transactions on Robotics 2021 (arXiv 2007.08073), as others quote it; the table itself was not
at hand. The paper's abstract says of UOIS-Net that its first stage "operates only on depth" and
that its masks are then "refined using RGB". Protocol: all 111 images, RGB-D, the authors'
evaluation (github.com/chrisdxie/uois, src/evaluation.py), which `mask_scores` follows: borders
match within ceil(0.003 x image diagonal) = 3 pixels. That code sets no margin above a floor: a
network decides by itself what is table.

Later methods (UCN, UOAIS-Net, MSMFormer, UOIS-SAM) report on the same images, but no text with
their figures was at hand to check, so they are left out.
"""

from typing import NamedTuple


class PublishedMasks(NamedTuple):
    """A row of a published table.

    Args:
        method: its name.
        sees: what its network takes.
        overlap_f: mean overlap F, in [0, 1].
        boundary_f: mean boundary F, in [0, 1].
    """

    method: str
    sees: str
    overlap_f: float
    boundary_f: float


PROTOCOL = "all 111 images of the database, 3 pixels of tolerance, no margin above a floor"
SOURCE = "Xie et al. 2021, table II"
UOIS_NET = PublishedMasks("UOIS-Net-3D", "depth, masks refined with colour", 0.833, 0.712)
ROWS = (
    UOIS_NET,
    PublishedMasks("PointGroup", "depth and colour", 0.788, 0.654),
    PublishedMasks("Mask R-CNN", "depth and colour", 0.741, 0.538),
)
