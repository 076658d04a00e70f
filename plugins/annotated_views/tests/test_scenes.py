import numpy as np
import pytest

from scenefw.core.errors import ConfigError
from scenefw.core.types import Pose, SceneObject
from scenefw.data.batches.stacks import StackScenes
from scenefw.noise.gaussian import Gaussian
from scenefw.noise.pose import Jitter
from scenefw.renderers.mesh_raycaster import MeshRaycaster
from scenefw.scenes.cameras import RandomViewpoints
from scenefw.shapes.solid_mesh import SolidMesh
from scenefw.shapes.superquadric import Superquadric
from scenefw_annotated_views.annotations import AnnotatedView
from scenefw_annotated_views.scenes import StackViews, TabletopViews
from scenefw_tabletops.data.table_scenes import TabletopScenes
from scenefw_tabletops.scenes.tabletop import TabletopGenerator
from scenefw_tabletops.shapes.tabletop.library import ProceduralModels


def stacks(**words):
    scenes = StackScenes("stacks_v2", "test", 2)
    return StackViews(scenes, RandomViewpoints(64, 48), **words)


def test_visible_points_lie_on_the_superquadric_that_the_mask_names():
    source = stacks()
    for view in source.views(0, 2):
        camera = view.frame.camera
        v, u = np.mgrid[: camera.height, : camera.width]
        rays = np.stack(
            [(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)]
        )
        points = (rays * view.frame.depth).reshape(3, -1).T
        world = points @ camera.T_world_camera[:3, :3].T + camera.T_world_camera[:3, 3]
        for item, one, true in zip(
            view.objects, view.silhouettes, source.scenes.objects(0), strict=True
        ):
            own = (world[one.visible.ravel()] - item.pose.position) @ item.pose.rotation
            assert np.abs(true.shape.first_order_distance(own)).max() < 0.001
            assert not (one.visible & ~one.mask).any()
        hidden = ~np.any([one.visible for one in view.silhouettes], axis=0) & (view.frame.depth > 0)
        assert np.abs(world[hidden.ravel(), 2]).max() < 1e-4  # the floor


def test_a_view_depends_on_its_number_alone():
    first, second = (list(stacks().views(1, count)) for count in (1, 3))
    assert np.array_equal(first[0].frame.depth, second[0].frame.depth)
    poses = {view.frame.camera.T_world_camera.tobytes() for view in second}
    assert len(poses) == 3
    noisy = next(iter(stacks(noise={"gaussian": Gaussian(0.01)}).views(1, 1)))
    assert not np.array_equal(noisy.frame.depth, first[0].frame.depth)
    assert np.array_equal(noisy.silhouettes[0].mask, first[0].silhouettes[0].mask)


def test_half_turns_leave_a_superquadric_as_it_is():
    (item, *_) = stacks().objects(0)
    shape = stacks().scenes.objects(0)[0].shape
    for turn in item.symmetries:
        assert np.linalg.det(turn) == 1
        assert np.abs(shape.first_order_distance(item.mesh.vertices @ turn.T)).max() < 1e-6


class OfMeshes:
    indices = np.array([4, 7])

    def __len__(self):
        return 2

    def objects(self, row):
        mesh = Superquadric((0.05, 0.05, 0.05), (4.0, 4.0, 4.0)).mesh(4)
        names = ("mug", "bowl") if row == 0 else ("bowl",)
        pose = Pose(np.zeros(3), np.array([1.0, 0, 0, 0]))
        return tuple(
            SceneObject(SolidMesh(mesh.vertices, mesh.faces, name=n), pose, 1) for n in names
        )


def test_meshes_of_files_are_models_and_categories_by_their_names():
    source = StackViews(OfMeshes(), RandomViewpoints(16, 12))
    assert source.categories == ("bowl", "mug")
    assert [source.keys(scene) for scene in (0, 1)] == [["mug", "bowl"], ["bowl"]]
    assert [item.category for item in source.objects(0)] == [1, 0]
    assert source.objects(0)[0].symmetries is None


def test_masks_of_table_tops_agree_with_the_labels_of_the_renderer():
    scenes = TabletopScenes(
        TabletopGenerator(ProceduralModels()), MeshRaycaster(), "test", 1, size=(80, 60)
    )
    source = TabletopViews(scenes)
    assert source.categories[0] == "remote_control"
    view = next(iter(source.views(0, 1)))
    assert isinstance(view, AnnotatedView)
    shown = np.zeros(view.frame.depth.shape, int)
    for item, one in zip(view.objects, view.silhouettes, strict=True):
        shown[one.visible] = item.category + 1
    assert (shown > 0).mean() > 0.05
    assert (shown == view.frame.labels).mean() > 0.999
    assert view.frame.colour is not None
    assert len(source.keys(0)) == len(view.objects)


def test_a_detail_that_makes_no_mesh_is_refused():
    with pytest.raises(ConfigError, match=r"views\.detail = 1"):
        stacks(detail=1)


def test_noise_of_poses_is_refused():
    with pytest.raises(ConfigError, match="leave out the pose noise tracking"):
        stacks(noise={"tracking": Jitter()})
