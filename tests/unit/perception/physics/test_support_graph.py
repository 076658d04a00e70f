import numpy as np
import pytest
from tests.unit.perception.edited_scenes import box

from scenefw.core.types import SceneObject
from scenefw.perception.estimate.objects import estimate_objects
from scenefw.perception.physics.support_graph import SupportGraph, support_graph
from scenefw_simulators.body_maker import BodyMaker
from scenefw_simulators.motions import motions


def graph_of(*boxes):
    """Of boxes, full size and centre each, with ids from 1 on."""
    meshes = {label: box(*sides) for label, sides in enumerate(boxes, start=1)}
    return support_graph(estimate_objects(meshes, dict.fromkeys(meshes, 1.0), {}))


FOOT = (0.1, 0.1, 0.1)


def test_a_tower_falls_from_where_something_goes():
    graph = graph_of((FOOT, (0, 0, 0.05)), (FOOT, (0, 0, 0.15)), (FOOT, (0.02, 0, 0.25)))
    assert graph.stands_on == {1: (SupportGraph.FLOOR,), 2: (1,), 3: (2,)}
    assert [graph.falls(label) for label in (1, 2, 3)] == [(2, 3), (3,), ()]
    assert graph.removal_order() == (3, 2, 1)


def test_a_bridge_needs_both_of_its_feet_and_a_table_two_of_three():
    plank = ((0.5, 0.1, 0.02), (0, 0, 0.11))
    left, right = (FOOT, (-0.2, 0, 0.05)), (FOOT, (0.2, 0, 0.05))
    bridge = graph_of(left, right, plank)
    assert bridge.stands_on[3] == (1, 2)
    assert bridge.falls(1) == bridge.falls(2) == (3,)
    assert bridge.removal_order()[0] == 3
    carried = graph_of(left, right, plank, (FOOT, (0, 0, 0.05)))
    assert carried.falls(1) == carried.falls(2) == ()
    assert carried.falls(4, gone=(1,)) == (3,)


def test_what_stands_side_by_side_carries_nothing():
    beside = graph_of((FOOT, (0, 0, 0.05)), (FOOT, (0.098, 0, 0.0495)))  # 2 mm into each other
    assert beside.stands_on == {1: (SupportGraph.FLOOR,), 2: (SupportGraph.FLOOR,)}
    low = graph_of((FOOT, (0, 0, 0.049)), ((0.1, 0.1, 0.02), (0.098, 0, 0.01)))
    assert low.stands_on == {1: (SupportGraph.FLOOR,), 2: (SupportGraph.FLOOR,)}


def test_predictions_that_hover_or_sink_a_little_are_carried():
    hovering = graph_of((FOOT, (0, 0, 0.05)), (FOOT, (0, 0, 0.154)))
    sunk = graph_of((FOOT, (0, 0, 0.05)), (FOOT, (0, 0, 0.13)))
    assert hovering.stands_on[2] == sunk.stands_on[2] == (1,)
    far = graph_of((FOOT, (0, 0, 0.05)), (FOOT, (0, 0, 0.18)))
    assert far.stands_on[2] == ()
    assert far.falls(1) == ()  # whatever carries it is not seen


def test_what_leans_out_too_far_falls_with_its_counterweight():
    base, weight = (FOOT, (0, 0, 0.05)), ((0.1, 0.1, 0.05), (-0.06, 0, 0.145))
    plank = ((0.3, 0.1, 0.02), (0.08, 0, 0.11))
    graph = graph_of(base, plank, weight)
    assert graph.stands_on == {1: (SupportGraph.FLOOR,), 2: (1,), 3: (2,)}
    assert graph.falls(1) == (2, 3)


def test_a_scene_without_objects_has_no_order():
    graph = support_graph([])
    assert graph.removal_order() == ()
    assert graph.stands_on == {}


def test_each_object_is_taken_once_and_none_falls_if_nothing_need():
    rng = np.random.default_rng(3)
    boxes = [
        ((0.06, 0.06, 0.04), (*rng.uniform(-0.1, 0.1, 2), 0.02 + 0.04 * (i % 3))) for i in range(9)
    ]
    graph = graph_of(*boxes)
    order = graph.removal_order()
    assert sorted(order) == list(range(1, 10))
    for count, label in enumerate(order):
        here = order[:count]
        fewest = min(len(graph.falls(k, here)) for k in order[count:])
        assert len(graph.falls(label, here)) == fewest


# Length and middle of a plank on boxes at 0, 0.2 and 0.4 m, too far apart to jam between two
PLANKS = [(0.5, 0.2), (0.3, 0.1), (0.1, 0.0), (0.3, 0.3), (0.14, 0.2), (0.46, 0.15)]


@pytest.mark.parametrize(("length", "middle"), PLANKS)
def test_what_falls_in_a_simulation_is_what_the_graph_says(length, middle):
    pytest.importorskip("pybullet", reason="needs pybullet (pip install 'scenefw[simulation]')")
    from scenefw_simulators.engines.pybullet_engine import PyBulletEngine

    boxes = [((0.06, 0.06, 0.12), (0.2 * i, 0.01 * i, 0.06)) for i in range(3)]
    boxes.append(((length, 0.06, 0.03), (middle, 0.0, 0.135)))
    graph = graph_of(*boxes)
    bodies = BodyMaker().make({k: box(*b) for k, b in enumerate(boxes, start=1)}, {}).bodies
    engine = PyBulletEngine()
    assert not moved(bodies, engine)  # it stands as it is
    for label in bodies:
        rest = {k: body for k, body in bodies.items() if k != label}
        assert moved(rest, engine) == set(graph.falls(label)), label


def moved(bodies: dict[int, SceneObject], engine):
    ends = motions(list(bodies.values()), engine, 480)
    return {label for label, end in zip(bodies, ends, strict=True) if end.shift > 0.01}
