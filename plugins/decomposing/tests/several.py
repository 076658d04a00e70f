"""A method for several views that needs no weights, and meshes of scenes for it."""

import numpy as np
import trimesh
from tests.unit.perception.obstacles import OBSTACLES
from tests.unit.perception.usual_fits import TOLERANCES, object_fit

from scenefw.core.types import TriangleMesh
from scenefw.fitting.joint import JointFit
from scenefw.fitting.superquadrics import SuperquadricFit
from scenefw.mapping.inverse_ray_tracing import InverseRayTracing
from scenefw.perception.evidence.gathering import EvidenceGathering
from scenefw.perception.grouping.hulls import HullFilling
from scenefw.perception.grouping.merging import FitMerging
from scenefw.perception.grouping.relabelling import ObjectGrouping
from scenefw.perception.grouping.segment_fits import SegmentFits
from scenefw.perception.observation.doctor import Doctor
from scenefw.perception.observation.table_frame import TableFrame
from scenefw.perception.observation.workspace import WorkspaceFinder
from scenefw.perception.pipeline import ReconstructionPipeline
from scenefw.perception.segmentation.crease_segmentation import CreaseSegmentation
from scenefw_decomposing.reassignment import ResidualReassignment
from scenefw_decomposing.views_assembly import ViewsAssembly
from scenefw_decomposing.views_completion import ViewsCompletion
from scenefw_decomposing.views_grouping import ViewsGrouping
from scenefw_decomposing.views_observer import ViewsObserver
from scenefw_decomposing.views_segmentation import ViewsSegmentation


def views_fit(segmentation, grouping, joint=None, *, grid=None, fit=None):
    """Superquadrics fitted to objects of all views, joined by `joint`."""
    table = TableFrame(max_tilt=0.3, max_offset=0.002)
    return ReconstructionPipeline(
        ViewsAssembly(TOLERANCES),
        ViewsObserver(InverseRayTracing(), table, WorkspaceFinder(OBSTACLES), Doctor()),
        ViewsSegmentation(segmentation, grouping),
        grouping=joint,
        fit=object_fit(),
        completion=ViewsCompletion(fit or JointFit(SuperquadricFit()), TOLERANCES),
        grid=grid,
        samples=1,
    )


def fitted_parts(overlap=None, grid=None):
    """Superquadrics fitted to segments between creases of all views."""
    fits = SegmentFits(SuperquadricFit(), EvidenceGathering())
    merge, reassign = FitMerging(fits), ResidualReassignment(fits)
    grouping = ObjectGrouping(HullFilling(), None, merge)
    joint = ViewsGrouping(merge, reassign, overlap)
    return views_fit(CreaseSegmentation(), grouping, joint, grid=grid)


def boxes(*sides_and_places, table=None):
    """A mesh of boxes, sides and centres in metres; `table` is a box more."""
    made = []
    for sides, place in [*sides_and_places, *([table] if table else [])]:
        box = trimesh.creation.box(sides)
        made.append(box.subdivide().subdivide().apply_translation(place))
    whole = trimesh.util.concatenate(made)
    return TriangleMesh(np.asarray(whole.vertices), np.asarray(whole.faces, np.int64))


PAIR = (((0.2, 0.14, 0.1), (0.0, 0.0, 0.05)), ((0.1, 0.08, 0.12), (0.03, 0.0, 0.16)))
"""A small box on a large one."""
TABLE = ((1.2, 1.0, 0.02), (0.0, 0.0, -0.01))
