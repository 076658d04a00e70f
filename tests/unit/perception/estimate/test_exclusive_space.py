"""Boxes that share space, whose volumes are known, leave it to the surer one."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.unit.perception.edited_scenes import UPRIGHT, block, box

from scenefw.core.types import PlacedShape, Pose
from scenefw.perception.estimate.contacts import overlaps
from scenefw.perception.estimate.exclusive_space import exclusive
from scenefw.perception.estimate.objects import estimate_objects
from scenefw.shapes.moments import moments
from scenefw.shapes.solid_mesh import closed
from scenefw.shapes.vessel import Vessel

CUBE = (0.1, 0.1, 0.1)


def objects_of(*boxes, confidences=(0.9, 0.5, 0.3, 0.2)):
    """Of boxes, full size and centre each, with ids from 1 on, the surest first."""
    meshes = {label: box(*sides) for label, sides in enumerate(boxes, start=1)}
    return estimate_objects(meshes, dict(zip(meshes, confidences, strict=False)), {})


def volumes(objects):
    return [moments(item.mesh).volume for item in objects]


def test_the_surer_one_keeps_what_two_fill():
    before = objects_of((CUBE, (0, 0, 0.05)), (CUBE, (0.08, 0, 0.05)))
    for order, lost in ((before, 1), (before[::-1], 0)):
        after = exclusive(order)
        assert [item.id for item in after] == [item.id for item in order]
        assert volumes(after)[lost] == pytest.approx(0.1 * 0.1 * 0.08, rel=1e-6)
        assert after[1 - lost] is order[1 - lost]
        assert after[lost].extents.min() == pytest.approx(0.08)
        assert closed(after[lost].mesh)
        assert not overlaps(after)


def test_nothing_is_below_the_floor():
    (sunk,) = exclusive(objects_of((CUBE, (0, 0, 0.03))))
    assert sunk.mesh.vertices[:, 2].min() == pytest.approx(0)
    assert volumes([sunk]) == pytest.approx([0.1 * 0.1 * 0.08])


def test_what_touches_keeps_its_shape():
    placed = {1: block(CUBE, (0, 0, 0.05)), 2: block(CUBE, (0.098, 0, 0.047))}
    meshes = {label: item.mesh() for label, item in placed.items()}
    before = estimate_objects(meshes, {1: 0.9, 2: 0.8}, placed)
    assert exclusive(before) == before


def test_a_shape_that_loses_space_is_a_mesh_with_its_confidence_and_cues():
    placed = {1: block(CUBE, (0, 0, 0.05)), 2: block(CUBE, (0.08, 0, 0.05))}
    meshes = {label: item.mesh() for label, item in placed.items()}
    before = estimate_objects(meshes, {1: 0.9, 2: 0.8}, placed)
    before = tuple(replace(item, cues={"hull": float(item.id)}) for item in before)
    surer, other = exclusive(before)
    assert surer is before[0]
    assert other.placed is None
    assert (other.id, other.confidence, other.cues) == (2, 0.8, {"hull": 2.0})


def test_an_object_stays_in_one_piece():
    wall = ((0.02, 0.3, 0.1), (0.02, 0, 0.05))
    _, cut = exclusive(objects_of(wall, ((0.2, 0.1, 0.1), (0, 0, 0.05))))
    assert volumes([cut]) == pytest.approx([0.11 * 0.1 * 0.1])
    assert cut.mesh.vertices[:, 0].max() == pytest.approx(0.01)


def test_what_lies_wholly_in_another_stays():
    before = objects_of((CUBE, (0, 0, 0.05)), ((0.05, 0.05, 0.05), (0, 0, 0.05)))
    assert exclusive(before) == before


def test_what_lies_in_a_bowl_shares_nothing_with_it():
    vessel = Vessel(0.08, 1.0, 1.0, 0.06, 0.005)
    bowl = PlacedShape(vessel, Pose(np.array([0, 0, -vessel.mesh().vertices[:, 2].min()]), UPRIGHT))
    meshes = {1: bowl.mesh(), 2: box((0.04, 0.04, 0.04), (0, 0, 0.026))}
    before = estimate_objects(meshes, {1: 0.5, 2: 0.9}, {1: bowl})
    assert exclusive(before) == before


@settings(max_examples=30, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.tuples(*[st.floats(0.04, 0.12)] * 3),
            st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(0.02, 0.1)),
        ),
        min_size=2,
        max_size=4,
    )
)
def test_no_point_of_a_box_that_was_cut_is_in_a_surer_one(boxes):
    before = objects_of(*boxes)
    after = exclusive(before)
    inside_before = [contents(size, centre) for size, centre in boxes]
    for number, (old, new) in enumerate(zip(before, after, strict=True)):
        assert volumes([new])[0] <= volumes([old])[0] * (1 + 1e-9)
        if new is old:
            continue
        partners = {
            p
            for o in overlaps(before)
            for p in (o.first, o.second)
            if old.id in (o.first, o.second)
        }
        centroids = new.mesh.vertices[new.mesh.faces].mean(axis=1)
        assert inside_before[number](centroids, 1e-6).all()
        if number and partners & {1}:  # the surest one is never cut but by the floor
            assert not (inside_before[0](centroids, -1e-6) & (centroids[:, 2] > 1e-6)).any()


def contents(size, centre):
    """Whether points (N, 3) lie in a box that is larger by a margin on all sides."""
    return lambda points, margin: (np.abs(points - centre) < np.array(size) / 2 + margin).all(
        axis=1
    )
