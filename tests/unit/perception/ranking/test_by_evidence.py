from dataclasses import replace

import numpy as np
import pytest
from tests.unit.perception.pipelines import KnownBoxes, pipeline_of
from tests.unit.perception.synthetic import camera_at, frame_of
from tests.unit.perception.usual_fits import TOLERANCES

from scenefw.core.geometry import rigid
from scenefw.core.types import GridSpec
from scenefw.fitting.placed import OUTLIERS
from scenefw.perception.estimate.transforms import moved, without
from scenefw.perception.ranking.by_evidence import EvidenceRanking

CAMERA = camera_at(eye=(0.0, -0.85, 0.6), size=(160, 120))
RANKING = EvidenceRanking(TOLERANCES)


def depth_of(scene):
    """The depth image of its objects and the floor, by Open3D."""
    o3d = pytest.importorskip("open3d")
    caster = o3d.t.geometry.RaycastingScene()
    for item in scene.objects:
        vertices = o3d.core.Tensor(np.float32(item.mesh.vertices))
        caster.add_triangles(vertices, o3d.core.Tensor(np.uint32(item.mesh.faces)))
    camera = scene.frame.camera
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    local = [(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)]
    pose = camera.T_world_camera
    directions = np.stack(local, -1) @ pose[:3, :3].T  # of depth 1
    eye = np.broadcast_to(pose[:3, 3], directions.shape)
    rays = o3d.core.Tensor(np.float32(np.concatenate([eye, directions], -1)))
    found = caster.cast_rays(rays)["t_hit"].numpy()
    floor = np.where(directions[..., 2] < 0, -eye[..., 2] / directions[..., 2], np.inf)
    depth = np.minimum(found, floor)
    return np.where(np.isfinite(depth), depth, 0).astype(np.float32)


@pytest.fixture(scope="module", params=[32, 64])
def scene(request):
    pipeline = pipeline_of(KnownBoxes(GridSpec(resolution=request.param)), samples=1)
    return pipeline.estimate(frame_of(CAMERA))


def shifted(scene, x=0.0, y=0.0):
    return moved(scene, {2: rigid(np.eye(3), (x, y, 0.0))})


def test_scenes_come_in_the_order_in_which_they_are_wrong(scene):
    one, three = shifted(scene, x=0.01), shifted(scene, x=0.03)
    gone = without(scene, {1, 2})
    ranked = RANKING.rank([scene, gone, three, one, scene])
    assert [one.details["evidence"]["hypothesis"] for one in ranked] == [1, 5, 4, 3, 2]
    shares = [one.details["evidence"]["explained"] for one in ranked]
    assert shares[0] == shares[1] > 0.6  # rays along edges meet the floor behind
    assert shares[1] > shares[2] > shares[3] > shares[4] == 0
    assert ranked[0].objects == scene.objects


def test_the_first_scene_stays_the_first(scene):
    ranked = RANKING.rank([without(scene, {1, 2}), scene])
    assert [one.details["evidence"]["hypothesis"] for one in ranked] == [1, 2]
    assert RANKING.rank([]) == []


def test_the_deviation_is_that_of_depth(scene):
    """What is measured is what is ray-cast, so that an exact scene has none."""
    depth = depth_of(scene)
    exact = replace(scene, frame=replace(scene.frame, depth=depth))
    evidence = RANKING.rank([exact])[0].details["evidence"]
    assert evidence["deviation"] * TOLERANCES.point_sigma < 1e-4
    assert evidence["explained"] == 1
    later = replace(exact, frame=replace(scene.frame, depth=np.where(depth > 0, depth + 0.004, 0)))
    evidence = RANKING.rank([later])[0].details["evidence"]
    assert evidence["deviation"] * TOLERANCES.point_sigma == pytest.approx(0.004, abs=1e-4)
    most = RANKING.rank([without(scene, {1, 2})])[0]
    assert most.details["evidence"]["deviation"] == pytest.approx(OUTLIERS, abs=0.05)


def test_what_the_image_does_not_show_costs_where_it_hides_the_floor(scene):
    """An object that is moved out of the pile covers floor that is seen."""
    aside = shifted(scene, x=0.25)
    found = RANKING.rank([scene, aside])[1].details["evidence"]
    assert found["explained"] < RANKING.rank([scene])[0].details["evidence"]["explained"]


def test_an_image_of_the_floor_alone_has_no_evidence(scene):
    bare = without(scene, {1, 2})
    points = replace(bare.frame, depth=np.zeros_like(bare.frame.depth))
    found = RANKING.rank([replace(bare, frame=points)])[0].details["evidence"]
    assert found == {"deviation": None, "explained": None, "hypothesis": 1}


def test_the_pipeline_ranks_and_says_so(scene):
    class Reversed:
        def rank(self, scenes):
            self.scenes = scenes
            return scenes[::-1]

    pipeline = pipeline_of(KnownBoxes(scene.grid), samples=3, ranking=RANKING)
    view = pipeline.observe(frame_of(CAMERA))
    hypotheses = [each.details["evidence"]["hypothesis"] for each in pipeline.reconstruct(view)]
    assert hypotheses == [1, 2, 3]
    pipeline.ranking = Reversed()
    reverse = pipeline.reconstruct(view)
    assert len(reverse) == 3
    assert all(a is b for a, b in zip(reverse, pipeline.ranking.scenes[::-1], strict=True))
