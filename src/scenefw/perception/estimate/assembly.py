"""From hypotheses of objects to scene estimates: volumes, whole objects, meshes, masks."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import torch

from scenefw.core.types import SceneEstimate
from scenefw.matching.instances import renumbered_like
from scenefw.perception.estimate.carving import carve, whole_objects
from scenefw.perception.estimate.composition import composed, shell_meshes, with_shells
from scenefw.perception.estimate.exclusive_space import exclusive
from scenefw.perception.estimate.lost_objects import lost_objects
from scenefw.perception.estimate.marked_objects import called, marked_solids
from scenefw.perception.estimate.mask_cleanup import with_unmeasured_pixels, without_holes
from scenefw.perception.estimate.objects import estimate_objects
from scenefw.perception.estimate.plausibility import objects_with, plausible
from scenefw.perception.estimate.shape_cues import shape_cues
from scenefw.perception.evidence.visible_instances import visible_instances
from scenefw.perception.observation.components import DETAIL, EDGE
from scenefw.perception.observation.image_turns import turned, turned_pixels
from scenefw.perception.observation.points import world_points
from scenefw.perception.observation.surface_mesh import obstacles_of
from scenefw.perception.segmentation.colour_edges import colour_gradient
from scenefw.postprocessing.confidence import ExpectedOverlap, agreements
from scenefw.postprocessing.surfaces import instance_meshes

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

    from torch import Tensor

    from scenefw.core.batches import Completion, PartialTSDF
    from scenefw.core.types import Float64, Frame, GridSpec, Int32, TriangleMesh
    from scenefw.perception.observation.observation import Observation
    from scenefw.perception.steps import ObjectSet
    from scenefw.shapes.object_shell import ObjectShell

Item = TypeVar("Item")

_SHAPE_VOLUMES = ("tsdf", "votes")  # what objects are made of; other volumes are kept as they are


class SceneAssembly:
    """Makes scene estimates of hypotheses (group `assembly`).

    Args:
        carve: takes away what lies in free space, below the floor, or in a surer object; shapes of
            which much lies in free space or below the floor are replaced.
        calibration: from cues about objects to their expected IoU; None: it was not fitted.
    """

    def __init__(self, calibration: ExpectedOverlap | None = None, *, carve: bool = True) -> None:
        self.calibration, self.carve = calibration, carve

    def volumes(self, sets: Sequence[ObjectSet], view: Observation) -> list[Completion]:
        """TSDF and instances of each hypothesis as it is, once of one that stands several times."""
        scenes = {
            id(hypothesis): composed(hypothesis, view)
            for hypothesis in {id(s): s for s in sets}.values()
        }
        return [scenes[id(hypothesis)] for hypothesis in sets]

    def assemble(
        self, sets: Sequence[ObjectSet], view: Observation, origin: Mapping[str, Any]
    ) -> Iterator[SceneEstimate]:
        """The scene of each hypothesis; an object has the same id in all of them.

        Its confidence is the IoU with the truth to expect; without a calibration, how much the
        other hypotheses agree. In all hypotheses an object has its shell where more IoU is to be
        expected of that in the first one.

        Args:
            sets: the most typical one first.
            view: that shows the scene.
            origin: facts of the method, for the details.
        """
        partial = view.partial if self.carve else None
        volumes = self.volumes(sets, view)
        marks = marked_solids(view) if volumes[0].masks is not None else {}
        meshes = shell_meshes(sets[0].shells)
        solids = [
            {**_lasting({**_placed_meshes(scene), **meshes}, scene.masks, view), **marks}
            for scene in volumes
        ]
        lasting = {label for meshes in solids for label in meshes}
        shell_ids: set[int] = set()
        scenes = [cleaned(scene, view.grid, partial, lasting) for scene in volumes]
        if not lasting:
            first = scenes[0].instances[0].cpu().numpy()
            scenes = scenes[:1] + [numbered_like(scene, first) for scene in scenes[1:]]
        frame = view.frame if view.workspace is None else view.workspace.frame
        points = world_points(frame)
        obstacles = obstacles_of([view])
        colour = None if view.image is None else view.image.colour
        gradient = None if colour is None else colour_gradient(colour)
        for number, scene in enumerate(scenes):
            alternatives = [
                alternative.instances[0] for i, alternative in enumerate(scenes) if i != number
            ]
            agreement = agreements(scene.instances[0], alternatives)
            estimate = scene_estimate(
                scene, view.grid, frame, agreement, _details(view, origin), solids[number], points
            )
            if self.carve:
                estimate = plausible(estimate, view)
            if number == 0 and meshes:
                shell_ids = _surer(*self.alternatives(estimate, meshes, view, agreement))
            shells = {k: sets[number].shells[k] for k in sets[number].shells if k in shell_ids}
            estimate = with_confidence(
                _with_shells(estimate, shells), view, agreement, self.calibration
            )
            if self.carve:
                estimate = replace(estimate, objects=exclusive(estimate.objects))
            if gradient is not None and view.masks is None:  # who marks objects knows their ends
                estimate = _with_unmeasured_pixels(estimate, view, gradient)
            estimate = replace(estimate, obstacles=obstacles)
            if number == 0:
                estimate = _with_warning(estimate, view)
            estimate = _turned_back(estimate, view.turns)
            yield called(estimate, view.ids) if marks else estimate

    def alternatives(
        self,
        estimate: SceneEstimate,
        meshes: Mapping[int, TriangleMesh],
        view: Observation,
        agreement: Mapping[int, float],
    ) -> tuple[SceneEstimate, SceneEstimate]:
        """A scene, and the same with other meshes, closed, of its objects; how sure both are.

        Args:
            estimate: with masks.
            meshes: by id.
            view: that shows it.
            agreement: of hypotheses on each object, by id.
        """
        other = replace(estimate, objects=objects_with(estimate.objects, meshes))
        return (
            with_confidence(estimate, view, agreement, self.calibration),
            with_confidence(other, view, agreement, self.calibration),
        )


def _placed_meshes(scene: Completion) -> dict[int, TriangleMesh]:
    """Meshes of shapes, by label, some of which are too thin for voxels."""
    placed = scene.placed[0] if scene.placed else {}
    return {label: item.mesh() for label, item in placed.items()}


def _lasting(
    meshes: Mapping[int, TriangleMesh], masks: Tensor | None, view: Observation
) -> dict[int, TriangleMesh]:
    """Meshes, by label, of what is an object whatever its voxels are: too thin for them, perhaps.

    Its centre lies in the cube, and as much of it is visible as of the face of a cube that is no
    fragment.
    """
    if masks is None or view.image is None:
        return {}
    pixels, camera = masks[0].cpu().numpy(), view.image.camera
    areas = view.image.depth.astype(np.float64) ** 2 / (camera.fx * camera.fy)
    visible_areas = np.bincount(pixels.ravel(), areas.ravel(), minlength=max(meshes, default=0) + 1)
    return {
        label: mesh
        for label, mesh in meshes.items()
        if visible_areas[label] >= EDGE**2
        and view.grid.nearest_voxels(mesh.vertices.mean(axis=0))[1]
    }


def _surer(estimate: SceneEstimate, other: SceneEstimate) -> set[int]:
    """Ids of the objects of which another scene is surer."""
    pairs = zip(estimate.objects, other.objects, strict=True)
    return {item.id for item, rival in pairs if rival.confidence > item.confidence}


def _with_shells(estimate: SceneEstimate, shells: Mapping[int, ObjectShell]) -> SceneEstimate:
    """The scene with volumes and meshes of some objects' shells."""
    tsdf, instances = with_shells(estimate.tsdf, estimate.instances, shells, estimate.grid)
    objects = objects_with(estimate.objects, shell_meshes(shells))
    return replace(estimate, tsdf=tsdf, instances=instances, objects=objects)


def with_confidence(
    estimate: SceneEstimate,
    view: Observation,
    agreement: Mapping[int, float],
    calibration: ExpectedOverlap | None,
) -> SceneEstimate:
    """The scene with cues about its objects, and the confidence that these justify.

    Args:
        estimate: with masks.
        view: that shows it; of several images together there are no cues, and nothing changes.
        agreement: of hypotheses on each object, by id.
        calibration: from cues to confidence; None: agreement is the confidence.
    """
    if view.image is None:
        return estimate
    cues = shape_cues(estimate, view, agreement)
    objects = []
    for item in estimate.objects:
        numbers = cues[item.id]
        confidence = numbers["agreement"]
        if calibration is not None:
            confidence = float(calibration([[numbers[name] for name in calibration.names]])[0])
        objects.append(replace(item, confidence=confidence, cues=numbers))
    return replace(estimate, objects=tuple(objects))


def _with_unmeasured_pixels(
    estimate: SceneEstimate, view: Observation, gradient: Float64
) -> SceneEstimate:
    """The scene with masks of pixels without depth, too, by the gradient (H, W) of colour."""
    if estimate.masks is None:
        return estimate
    points = view.points if view.workspace is None else view.workspace.points
    unmeasured = np.isnan(points[..., 2])
    masks = with_unmeasured_pixels(
        estimate.masks, unmeasured, gradient, estimate.objects, estimate.frame.camera
    )
    return replace(estimate, masks=masks)


def _turned_back(estimate: SceneEstimate, turns: int) -> SceneEstimate:
    """With frame and masks as the image was before it was turned left by quarters."""
    if not turns:
        return estimate
    masks = None if estimate.masks is None else turned_pixels(estimate.masks, -turns)
    return replace(estimate, frame=turned(estimate.frame, -turns), masks=masks)


def _details(view: Observation, origin: Mapping[str, Any]) -> dict[str, Any]:
    """Facts worth keeping of a prediction."""
    floor = view.floor
    floor_details = {} if floor is None else {
        "floor": {
            "normal": floor.normal,
            "height": floor.height,
            "share": floor.share,
            "deviation": floor.deviation,
        }
    }  # fmt: skip
    return {**floor_details, **origin, "warnings": list(view.warnings)}


def _with_warning(estimate: SceneEstimate, view: Observation) -> SceneEstimate:
    """The scene with a warning if much of what stands in an image without marks is no object."""
    space, masks = view.workspace, estimate.masks
    if space is None or masks is None or view.masks is not None:
        return estimate
    line = lost_objects(
        turned_pixels(masks, -view.turns),
        turned_pixels(space.objects, -view.turns),
        turned_pixels(space.frame.depth, -view.turns),
    )
    if line is None or line in view.warnings:
        return estimate
    warnings = [*estimate.details["warnings"], line]
    return replace(estimate, details={**estimate.details, "warnings": warnings})


def cleaned(
    sample: Completion,
    grid: GridSpec,
    partial: PartialTSDF | None = None,
    lasting: Collection[int] = (),
) -> Completion:
    """A scene whose objects are in one piece each, and numbered from 1 on.

    Args:
        sample: a batch of one.
        grid: of its volumes.
        partial: what lies in its free space, or below the floor, is taken away; None: nothing is.
        lasting: labels of objects that stay, even where no voxel shows them.
    """
    shape = sample.tsdf[0] if partial is None else carve(sample.tsdf[0], partial, grid)
    tsdf, instances = whole_objects(shape, sample.instances[0], grid, lasting)
    return _with_instances(replace(sample, tsdf=tsdf[None]), instances, lasting)


def numbered_like(sample: Completion, reference: Int32) -> Completion:
    """A scene whose objects have the labels of another one (X, Y, Z) where they are the same."""
    labels = sample.instances[0]
    new_labels = torch.from_numpy(renumbered_like(labels.cpu().numpy(), reference)).to(
        labels.device
    )
    return _with_instances(sample, new_labels)


def scene_estimate(
    sample: Completion,
    grid: GridSpec,
    frame: Frame,
    confidence_of_label: Mapping[int, float],
    details: Mapping[str, Any],
    solids: Mapping[int, TriangleMesh] | None = None,
    points: Float64 | None = None,
) -> SceneEstimate:
    """The estimate of a completed scene.

    Args:
        sample: a batch of one.
        grid: of its volumes.
        frame: a view of it, with its pose.
        confidence_of_label: confidence of each object, by label.
        details: facts worth keeping.
        solids: meshes, by label, of objects that voxels may be too coarse for.
        points: (H, W, 3) of the frame in the world (m); None: they are computed.
    """
    tsdf, instances = sample.tsdf[0], sample.instances[0]
    placed = sample.placed[0] if sample.placed else {}
    exact = dict(sample.meshes[0]) if sample.meshes else {}
    exact |= {label: item.mesh() for label, item in placed.items()}
    labels = set(torch.unique(instances).tolist())
    meshes = dict(solids or {})
    meshes |= {label: mesh for label, mesh in exact.items() if label in labels | meshes.keys()}
    meshes |= instance_meshes(tsdf, instances, grid, selection=labels - exact.keys())
    return SceneEstimate(
        estimate_objects(meshes, confidence_of_label, placed),
        grid,
        tsdf.cpu().numpy(),
        instances.cpu().numpy(),
        frame,
        {"grid": asdict(grid), **details},
        {n: v[0].cpu().numpy() for n, v in sample.volumes.items() if n not in _SHAPE_VOLUMES},
        _masks(sample, grid, world_points(frame) if points is None else points),
    )


def _masks(sample: Completion, grid: GridSpec, points: Float64) -> Int32:
    """Which object each pixel shows: as the method says, else by the volume at its point.

    Where a method knows pixels, volumes give it no further ones: beside objects, pixels of blurred
    edges lie near them, too. But holes in objects are filled.
    """
    if sample.masks is not None:
        return without_holes(sample.masks[0].cpu().numpy(), points[..., 2])
    instances = sample.instances[0].cpu().numpy()
    return visible_instances(instances, points, grid, points[..., 2] > DETAIL)


def _with_instances(
    before: Completion, instances: Tensor, lasting: Collection[int] = ()
) -> Completion:
    """With other instances; all else gets the label that most of its voxels have now.

    Those of `lasting` objects stay.
    """
    old_labels, new_label_of = before.instances[0], {label: label for label in (0, *lasting)}
    for label in sorted(set(torch.unique(old_labels).tolist()) - new_label_of.keys()):
        votes = torch.bincount(instances[(old_labels == label) & (instances > 0)])
        new_label_of[label] = int(votes.argmax()) if len(votes) else 0
    masks = before.masks
    if masks is not None:
        table = torch.zeros(
            int(max(masks.max(), old_labels.max(), *new_label_of)) + 1, dtype=torch.int32
        )
        table[list(new_label_of)] = torch.tensor(list(new_label_of.values()), dtype=torch.int32)
        masks = table.to(masks.device)[masks.long()]
    placed = _relabelled(before.placed, new_label_of)
    meshes = _relabelled(before.meshes, new_label_of)
    return replace(before, instances=instances[None], masks=masks, placed=placed, meshes=meshes)


def _relabelled(
    views: Sequence[Mapping[int, Item]], new_label_of: Mapping[int, int]
) -> tuple[dict[int, Item], ...]:
    return tuple(
        {new_label_of[label]: item for label, item in view.items() if new_label_of.get(label)}
        for view in views
    )
