"""Rigid motions that take an object to where it may lie now, and which object became which."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core import geometry, rng
from scenefw.matching.assignment import Assignment
from scenefw.perception.evidence.mesh_distances import distances_to
from scenefw.perception.observation.points import SAMPLE
from scenefw.shapes.equal_descriptions import equal_descriptions
from scenefw.shapes.moments import moments

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from scenefw.core.types import Float64, ObjectEstimate, TriangleMesh

MIN_IOU = 0.5
"""IoU above which two solids are taken for the same object, as in panoptic quality (Kirillov et al.
2019)."""
_EQUAL_IOU = 1 / np.sqrt(SAMPLE)  # two standard deviations of such a share, if it is a half


@dataclass(frozen=True, eq=False)
class Motion:
    """How an object may have come to where another one lies.

    Args:
        matrix: rigid 4x4, in the coordinates of both.
        iou: of both after it, in [0, 1].
        shift: distance that the object's centre moves (m).
    """

    matrix: Float64
    iou: float
    shift: float = 0.0

    @property
    def is_rest(self) -> bool:
        """Whether the object lies where it lay."""
        return bool((self.matrix == np.eye(4)).all())


def rigid_motion(before: ObjectEstimate, after: ObjectEstimate) -> Motion:
    """The motion that makes an object overlap most with another; of equal ones the least.

    It is none, a shift of the centre, or takes principal axes to principal axes.
    """
    volumes = [moments(item.mesh).volume for item in (before, after)]
    if min(volumes) <= MIN_IOU * max(volumes):  # no motion overlaps by more
        return Motion(np.eye(4), 0.0)
    places, solid = _places_in(after.mesh), distances_to(before.mesh)
    centre, motions = before.pose.position, []
    for matrix in _candidates(before, after):
        inside = solid.inside(geometry.transform_points(geometry.inverse(matrix), places))
        shared = volumes[1] * np.count_nonzero(inside) / SAMPLE
        shift = np.linalg.norm(geometry.transform_points(matrix, centre[None])[0] - centre)
        motions.append(Motion(matrix, shared / max(sum(volumes) - shared, shared), float(shift)))
        if motions[0].iou > 1 - _EQUAL_IOU:
            break
    best = max(motion.iou for motion in motions)
    return next(motion for motion in motions if motion.iou >= best - _EQUAL_IOU)


def matched(
    before: Mapping[int, ObjectEstimate], after: Mapping[int, ObjectEstimate]
) -> dict[int, tuple[int, Motion]]:
    """Which object became which, by id of those that are there now.

    Together they overlap most after rigid motions; of objects that are alike, each is taken for one
    that was near.

    Args:
        before: objects by id.
        after: likewise, of another image; same coordinates.

    Returns:
        Id before and motion, for each object whose IoU is more than `MIN_IOU`.
    """
    if not before or not after:
        return {}
    old_ids, new_ids = list(before), list(after)
    motions = [[rigid_motion(before[i], after[k]) for k in new_ids] for i in old_ids]
    gains = np.array([[_gain(motion) for motion in row] for row in motions])
    pairs = Assignment().assign(-gains)
    return {
        new_ids[column]: (old_ids[row], motions[row][column])
        for row, column in pairs.tolist()
        if gains[row, column] > 0
    }


def _gain(motion: Motion) -> float:
    """What a pair is worth: its overlap, and if others are as good, that it was near."""
    if motion.iou <= MIN_IOU:
        return 0.0
    return motion.iou - _EQUAL_IOU * motion.shift / (motion.shift + 1)


def _candidates(before: ObjectEstimate, after: ObjectEstimate) -> Iterator[Float64]:
    """Rigid 4x4, those that turn least first."""
    yield np.eye(4)
    start, end = before.pose, after.pose
    turns = [np.eye(3)]
    turns += [end.rotation @ equal @ start.rotation.T for equal in _EQUAL_AXES]
    for turn in sorted(turns, key=lambda matrix: -np.trace(matrix)):
        yield geometry.rigid(turn, end.position - turn @ start.position)


def _places_in(mesh: TriangleMesh) -> Float64:
    """Places (N, 3) in a solid, evenly at random, always the same."""
    random, solid = rng.generator(0), distances_to(mesh)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    places = np.zeros((0, 3))
    for _ in range(SAMPLE):  # of a solid that fills a thousandth of its box, too
        box = random.uniform(low, high, (SAMPLE, 3))
        places = np.concatenate([places, box[solid.inside(box)]])
        if len(places) >= SAMPLE:
            break
    return places[:SAMPLE]


_EQUAL_AXES = equal_descriptions().numpy().astype(np.float64)
