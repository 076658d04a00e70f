"""The fit of objects and its tolerances, with the numbers of conf/."""

from scenefw.fitting.superquadrics import SuperquadricFit
from scenefw.perception.evidence.gathering import EvidenceGathering
from scenefw.perception.evidence.object_fit import ObjectFit
from scenefw.perception.evidence.tolerances import Tolerances

TOLERANCES = Tolerances(
    point_sigma=0.003,
    outside_sigma=0.004,
    floor_margin=0.005,
    min_pixels=60,
    inlier_distance=0.006,
    min_inlier_ratio=0.75,
    max_free_ratio=0.05,
)


def object_fit(min_height=0.015):
    """Superquadrics of single objects."""
    return ObjectFit(SuperquadricFit(), EvidenceGathering(), min_height)
