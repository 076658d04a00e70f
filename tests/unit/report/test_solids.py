"""Predicted scenes as what pictures are drawn from."""

from dataclasses import replace

import numpy as np
from tests.unit.report.test_overview import estimate_of

from scenefw.core.types import ObjectEstimate, PlacedShape, Pose
from scenefw.report.palette import instance_colours
from scenefw.report.solids import solid_of
from scenefw.shapes.superquadric import Superquadric
from scenefw.shapes.vessel import Vessel

UPRIGHT = np.array([1.0, 0, 0, 0])
BOWL = Vessel(0.12, 0.5, 0.6, 0.1, 0.005)


def placed(shape, height):
    return PlacedShape(shape, Pose(np.array([0.0, 0.0, height]), UPRIGHT))


def bowl_with_a_ball():
    """A bowl on the floor, and a ball in it; volumes have the bowl with a lid on."""
    base = estimate_of(resolution=64)
    bowl, ball = placed(BOWL, -BOWL.bottom), placed(Superquadric([0.03] * 3, [2] * 3), 0.045)
    local = base.grid.centres() - bowl.pose.position
    filled = BOWL.filled_distance(local)
    inner = np.linalg.norm(base.grid.centres() - ball.pose.position, axis=-1) - 0.03
    tsdf = np.where(inner < 0, inner, np.minimum(filled, base.grid.truncation))
    labels = np.where(inner < 0, 2, np.where(filled < 0, 1, 0)).astype(np.int32)
    items = tuple(
        ObjectEstimate(k, one.mesh(), one.pose, np.full(3, 0.1), 1.0, one)
        for k, one in ((1, bowl), (2, ball))
    )
    return replace(base, objects=items, tsdf=tsdf.astype(np.float32), instances=labels), filled


def test_the_floor_sees_a_lid_and_what_lies_in_a_bowl_is_lit():
    scene, filled = bowl_with_a_ball()
    solid = solid_of(scene, instance_colours(2))
    grid = scene.grid
    assert (solid.tsdf[filled < -grid.voxel_size] < 0).all()  # shadows of all of it
    above = np.linalg.norm(grid.centres() - [0, 0, 0.088], axis=-1) < 0.015  # over the ball
    assert above.any()
    assert (solid.hollow[above] > 0).all()
    assert (solid.hollow[scene.instances == 2] < 0).mean() > 0.9  # the ball casts its own
    walls = (np.abs(filled) < 0.3 * BOWL.wall) & (grid.centres()[..., 2] < 0.09)  # not the lid
    assert (solid.hollow[walls & (filled < 0)] < BOWL.wall).all()


def test_without_vessels_there_is_one_field():
    scene = estimate_of(resolution=48)
    solid = solid_of(scene, instance_colours(1))
    assert solid.hollow is None
    assert solid.surfaces is not None
