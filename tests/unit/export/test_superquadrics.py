import json
from dataclasses import replace

import numpy as np
from tests.unit.export.stacks import COLOURS, stack

from scenefw.core.types import PlacedShape, Pose
from scenefw.export.superquadrics import Superquadrics
from scenefw.shapes.superquadric import Superquadric


def test_numbers_give_the_surface_back(tmp_path):
    estimate = stack()
    shape = Superquadric(np.array([0.1, 0.05, 0.02]), np.array([2.0, 3.0, 40.0]))
    placed = PlacedShape(shape, Pose(np.array([0.1, 0.2, 0.3]), np.array([0.8, 0.6, 0.0, 0.0])))
    first, *others = estimate.objects
    estimate = replace(estimate, objects=(replace(first, placed=placed), *others))
    path = tmp_path / "scene.superquadrics.json"
    Superquadrics().write(path, estimate, COLOURS)
    told = json.loads(path.read_text())
    assert told["unexplained"] == [2, 3]
    (one,) = told["superquadrics"]
    assert (one["id"], one["kind"]) == (1, "superquadric")
    pose = Pose(np.array(one["position"]), np.array(one["quaternion"]))
    local = (placed.mesh().vertices - pose.position) @ pose.rotation
    values = (np.abs(local / one["half_axes"]) ** one["exponents"]).sum(axis=1)
    np.testing.assert_allclose(values, 1, atol=1e-4)
