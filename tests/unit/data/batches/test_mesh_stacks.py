"""Scenes of meshes: generated, stored, read, and as volumes with exact distances."""

import numpy as np
import pytest
import torch
import trimesh

from scenefw.core.errors import ConfigError, InputError, StorageError
from scenefw.core.types import GridSpec, PlacedShape, Pose, Scene, SceneObject
from scenefw.data.batches.mesh_stacks import MeshStacks, scene_set
from scenefw.data.batches.stacks import StackScenes
from scenefw.data.batches.views import ViewMaker
from scenefw.mapping.projective import Projective
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw.representations.mesh_volumes import ExactSolids, SolidScenes
from scenefw.representations.volumes import scene_volumes
from scenefw.scenes.cameras import RandomViewpoints
from scenefw.scenes.storage import concatenate, load_scenes, pack, save_scenes
from scenefw.shapes.solid_mesh import SolidMesh
from scenefw.shapes.superquadric import Superquadric
from scenefw_simulators.engines.pybullet_engine import PyBulletEngine
from scenefw_simulators.generation.generate import Generate
from scenefw_simulators.generation.stacks import StackGenerator
from scenefw_single_view_benchmarks.mesh_solids import MeshSolids
from scenefw_sweeps.local import Local

GRID = GridSpec(resolution=48)
UPRIGHT = np.array([1.0, 0, 0, 0])


def ellipsoid():
    whole = Superquadric([0.12, 0.08, 0.06], [2, 2, 2])
    mesh = whole.mesh(40)
    return whole, SolidMesh(mesh.vertices, mesh.faces, name="ellipsoid")


@pytest.fixture
def file(tmp_path):
    """A file of three scenes of one or two ellipsoids."""
    _, solid = ellipsoid()
    parts = (solid.vertices[:9], solid.vertices[5:20])
    other = SolidMesh(0.5 * solid.vertices, solid.faces, parts, "small")
    turned = np.array([0.8, 0, 0.6, 0])
    scenes = [
        Scene(
            tuple(
                SceneObject(shape, Pose(np.array([0.2 * i, 0.05, 0.1]), turned), 0.3 + i)
                for i, shape in enumerate([solid, other][: 1 + index % 2])
            ),
            index, 5, "test",
        )
        for index in range(3)
    ]  # fmt: skip
    stored = concatenate([pack(scenes[1:]), pack([]), pack(scenes[:1])])
    return save_scenes(tmp_path / "solids.npz", stored, {"seed": 5})


def test_scenes_come_back_as_they_were_stored(file):
    _, solid = ellipsoid()
    stored = load_scenes(file)
    assert stored.index.tolist() == [0, 1, 2]
    scene = stored.scene(1)
    assert [item.shape.name for item in scene.objects] == ["ellipsoid", "small"]
    np.testing.assert_allclose(scene.objects[0].shape.vertices, solid.vertices, atol=1e-7)
    assert [len(part) for part in scene.objects[1].shape.parts] == [9, 15]
    np.testing.assert_allclose(scene.objects[1].pose.quaternion, [0.8, 0, 0.6, 0], atol=1e-7)
    assert scene.objects[1].mass == pytest.approx(1.3)
    assert stored.shapes("test") == {b"ellipsoid", b"small"}


def test_a_file_is_known_by_what_it_holds(file):
    scenes = scene_set(file, "test", limit=2)
    assert isinstance(scenes, MeshStacks)
    assert scenes.indices.tolist() == [0, 1]
    assert isinstance(scene_set(None, "val", limit=1), StackScenes)
    with pytest.raises(ConfigError, match="no scene of the split train"):
        scene_set(file, "train")
    with pytest.raises(StorageError, match="no data set at"):
        scene_set(file.with_name("missing.npz"))


def test_superquadrics_and_meshes_are_not_mixed(file):
    item = SceneObject(Superquadric([0.1] * 3, [2] * 3), Pose(np.zeros(3), UPRIGHT), 1.0)
    with pytest.raises(StorageError, match="meshes"):
        concatenate([load_scenes(file), pack([Scene((item,), 9, 0)])])
    with pytest.raises(StorageError, match="beside meshes"):
        pack([Scene((item,), 9, 0), load_scenes(file).scene(0)])


def test_volumes_of_meshes_are_those_of_the_superquadric(file):
    pytest.importorskip("open3d", reason="needs open3d (pip install 'scenefw[open3d]')")
    whole, solid = ellipsoid()
    pose = Pose(np.array([0.1, -0.05, 0.2]), np.array([0.8, 0, 0.6, 0]))
    positions = torch.from_numpy(pose.position[None, None]).float()
    found = ExactSolids(SolidScenes(((SceneObject(solid, pose, 1.0),),), positions), GRID).volumes
    stacks = StackScenes(split="val", limit=1).parameters([0])
    one = type(stacks)(
        torch.tensor([[whole.half_axes.tolist()]]),
        torch.tensor([[whole.exponents.tolist()]]),
        torch.from_numpy(pose.rotation[None, None]).float(),
        positions,
        torch.ones(1, 1, dtype=torch.bool),
    )
    exact = scene_volumes(one, GRID)
    assert (found.tsdf - exact.tsdf).abs().max() < 0.05 * GRID.voxel_size
    sure = exact.tsdf[:, 0].abs() > 0.05 * GRID.voxel_size
    assert torch.equal(found.instances[sure], exact.instances[sure])
    inside = (found.instances > 0) & (exact.instances > 0)
    difference = (found.votes - exact.votes).permute(0, 2, 3, 4, 1)[inside].abs()
    assert difference.max() < 1e-3


def test_views_show_them(file):
    pytest.importorskip("open3d", reason="needs open3d (pip install 'scenefw[open3d]')")
    viewpoints = RandomViewpoints(width=80, height=60)
    maker = ViewMaker(GRID, viewpoints, SphereTracer(floor=False), Projective())
    scenes = scene_set(file, "test")
    batch = maker.make_one(scenes.parameters([1]), np.random.default_rng(0))
    assert set(torch.unique(batch.volumes.instances).tolist()) == {0, 1, 2}
    assert (batch.depth > 0).any()
    assert batch.partial.observed.any()


def test_generated_stacks_of_meshes_stand(tmp_path):
    pytest.importorskip("pybullet", reason="needs pybullet (pip install 'scenefw[simulation]')")
    trimesh.creation.box([0.12, 0.1, 0.05]).export(tmp_path / "box.ply")
    trimesh.creation.box([0.06, 0.05, 0.04]).export(tmp_path / "brick.ply")
    source = MeshSolids(str(tmp_path))
    generator = StackGenerator(source, PyBulletEngine(), minimum=2, maximum=2, split="test")
    folders = {"shards": str(tmp_path / "shards"), "output": str(tmp_path / "out")}
    Generate(generator, Local(1), attempts=2, scene="boxes", **folders).run()
    stored = load_scenes(tmp_path / "out" / "boxes.npz")
    assert len(stored) >= 1
    assert stored.shapes("test") <= {b"box", b"brick"}
    lowest = []
    for item in stored.scene(0).objects:
        np.testing.assert_array_equal(item.shape.vertices, source.solid(item.shape.name).vertices)
        lowest.append(PlacedShape(item.shape, item.pose).mesh().vertices[:, 2].min())
    assert min(lowest) == pytest.approx(0, abs=5e-4)


@pytest.mark.parametrize(
    ("split", "limit", "said"),
    [
        ("tests", None, "split is 'tests', expected one of"),
        ("test", 0, "limit of scenes is 0"),
        ("test", -1, "limit of scenes is -1"),
        ("val", None, "no scene of the split val"),
        ("final", None, "final split of solids is for releases"),
    ],
)
def test_wrong_arguments_are_one_line(file, split, limit, said):
    with pytest.raises(ConfigError, match=said) as raised:
        MeshStacks(file, split, limit)
    assert "\n" not in str(raised.value)


def test_views_of_meshes_have_no_superquadrics(file):
    views = ViewMaker(GRID, RandomViewpoints(width=40, height=30), SphereTracer(), Projective(), {})
    made = views.make_one(MeshStacks(file, "test", 1).parameters([0]), np.random.default_rng(0))
    with pytest.raises(InputError, match="views of ExactSolids show no superquadrics"):
        _ = made.superquadrics
