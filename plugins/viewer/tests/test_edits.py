import numpy as np
import pytest
from tests.unit.perception.pipelines import KnownBoxes, pipeline_of
from tests.unit.perception.synthetic import camera_at, frame_of

from scenefw.core.geometry import rigid
from scenefw.core.types import GridSpec
from scenefw_viewer.edits import Edits

GRID = GridSpec(resolution=32)
CAMERA = camera_at(eye=(0.0, -0.85, 0.6), size=(160, 120))


@pytest.fixture(scope="module")
def scene():
    return pipeline_of(KnownBoxes(GRID), samples=1).estimate(frame_of(CAMERA))


def test_nothing_done_is_the_prediction_itself(scene):
    edits = Edits(scene)
    assert edits.result() is scene
    assert not edits.changed
    assert edits.ids == [1, 2]


def test_removed_objects_leave_meshes_volumes_and_masks(scene):
    edits = Edits(scene)
    edits.remove(1)
    result = edits.result()
    assert [item.id for item in result.objects] == [2]
    assert set(np.unique(result.instances)) == {0, 2}
    assert set(np.unique(result.masks)) == {0, 2}
    inside = scene.instances == 1
    assert (result.tsdf[inside] > 0).mean() > 0.95
    assert set(np.unique(scene.masks)) == {0, 1, 2}  # the prediction stays
    edits.put_back(1)
    assert edits.result() is scene


def test_objects_are_placed_where_their_pose_says(scene):
    edits, shift = Edits(scene), rigid(np.eye(3), (0.2, 0.0, 0.0))
    before = edits.item(2)
    edits.place(2, shift @ before.pose.matrix)
    np.testing.assert_allclose(edits.motion(2), shift, atol=1e-12)
    after = edits.result().objects[1]
    np.testing.assert_allclose(after.mesh.vertices, before.mesh.vertices + (0.2, 0, 0), atol=1e-9)
    np.testing.assert_allclose(edits.pose(2)[:3, 3], after.pose.position, atol=1e-9)
    edits.remove(2)
    assert [item.id for item in edits.result().objects] == [1]
    edits.put_back(2)
    np.testing.assert_allclose(edits.pose(2), shift @ before.pose.matrix)
    edits.undo()
    assert edits.result() is scene
