"""Shapes that contradict an image of known boxes give way to humbler ones."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from tests.unit.perception.synthetic import Box, camera_at, cast_at, frame_of

from scenefw.core.types import GridSpec, PlacedShape, Pose, SceneEstimate, TriangleMesh
from scenefw.perception.estimate.objects import estimate_objects
from scenefw.perception.estimate.plausibility import columns_below, plausible
from scenefw.perception.evidence.mesh_distances import mesh_volumes
from scenefw.perception.observation.observation import Observation
from scenefw.perception.observation.points import world_points
from scenefw.shapes.vessel import Vessel

BOX = Box((-0.05, -0.05, 0.0), (0.05, 0.05, 0.12))
OTHER = Box((0.15, -0.05, 0.0), (0.2, 0.0, 0.1))


def solid(lower, upper):
    mesh = trimesh.creation.box(bounds=(lower, upper))
    return TriangleMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces))


def judged(mesh, resolution=64, size=(320, 240)):
    """The first object with a mesh of its own, and the other one, as it is."""
    camera = camera_at(eye=(0.1, -0.8, 0.6), size=size)
    frame = replace(frame_of(camera, (BOX, OTHER)), camera=camera)
    grid = GridSpec(resolution=resolution)
    meshes = {1: mesh, 2: solid(OTHER.lower, OTHER.upper)}
    tsdf, instances = mesh_volumes(list(meshes.items()), grid)
    objects = estimate_objects(meshes, {1: 0.8, 2: 0.8})
    estimate = SceneEstimate(objects, grid, tsdf, instances, frame, masks=frame.labels)
    return estimate, plausible(estimate, Observation(frame))


def test_what_agrees_stays():
    before, after = judged(solid(BOX.lower, BOX.upper))
    assert after is before


@pytest.mark.parametrize(
    "wrong",
    [
        ((-0.05, -0.05, -0.05), (0.05, 0.05, 0.12)),  # below the floor
        ((-0.05, -0.05, 0.04), (0.05, 0.05, 0.12)),  # hovers
        ((-0.05, -0.25, 0.0), (0.05, 0.05, 0.12)),  # before what was measured
        ((-0.05, -0.05, 0.0), (0.05, 0.4, 0.12)),  # far longer than what is visible
    ],
)
@pytest.mark.parametrize("resolution", [32, 64])
def test_what_contradicts_gives_way_to_what_is_visible(wrong, resolution):
    before, after = judged(solid(*wrong), resolution)
    first, second = after.objects
    assert second is before.objects[1]
    assert first.confidence == pytest.approx(0.8)
    low, high = first.mesh.vertices.min(axis=0), first.mesh.vertices.max(axis=0)
    np.testing.assert_allclose(low, BOX.lower, atol=0.012)
    np.testing.assert_allclose(high[[0, 2]], np.array(BOX.upper)[[0, 2]], atol=0.012)
    assert -0.05 < high[1] < 0.06  # what is behind isn't visible
    assert trimesh.Trimesh(first.mesh.vertices, first.mesh.faces).is_watertight
    centres = after.grid.centres()[after.instances == 1]
    margin = after.grid.voxel_size / 2
    assert (centres > low - margin).all()
    assert (centres < high + margin).all()
    np.testing.assert_array_equal(after.instances == 2, before.instances == 2)


def test_a_vessel_is_judged_by_what_it_may_hold():
    """A camera doesn't see the rim that is nearest to it: much of a wall, little of a bowl."""
    shape = Vessel(0.08, 0.4, 0.5, 0.06, 0.004)
    bowl = PlacedShape(shape, Pose([0, 0, -shape.bottom], [1, 0, 0, 0]))
    mesh = bowl.mesh()
    camera = camera_at(eye=(0.0, -0.6, 0.6))
    frame = replace(frame_of(camera, (OTHER,)), camera=camera)
    depth, is_bowl = cast_at(mesh, camera)
    y = world_points(replace(frame, depth=depth))[..., 1]
    visible = is_bowl & (y > -0.05)
    frame = replace(frame, depth=np.where(visible, depth, frame.depth).astype(np.float32))
    grid = GridSpec()
    tsdf, instances = mesh_volumes([(1, mesh)], grid)
    walls = estimate_objects({1: mesh}, {1: 0.8})
    vessel = estimate_objects({1: mesh}, {1: 0.8}, {1: bowl})
    estimate = SceneEstimate(vessel, grid, tsdf, instances, frame, masks=visible.astype(np.int32))
    assert plausible(estimate, Observation(frame)) is estimate
    as_mesh = plausible(replace(estimate, objects=walls), Observation(frame))
    assert as_mesh.objects[0].mesh is not mesh
    unseen = Observation(replace(frame, depth=frame_of(camera, (OTHER,)).depth))
    assert plausible(estimate, unseen) is not estimate


def test_columns_hold_what_is_below_points():
    points = np.random.default_rng(0).uniform((0, 0, 0.1), (0.1, 0.06, 0.1), (5000, 3))
    mesh = columns_below(points, 0.02)
    body = trimesh.Trimesh(mesh.vertices, mesh.faces)
    assert body.is_watertight
    assert body.volume == pytest.approx(0.1 * 0.06 * 0.08, rel=0.12)  # cells of 5 mm
    assert body.bounds[0, 2] == pytest.approx(0.02, abs=1e-6)
