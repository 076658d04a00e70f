"""Which objects of a view become hollow."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial import cKDTree
from tests.unit.perception.synthetic import cast_at
from tests.unit.perception.usual_fits import TOLERANCES

import scenefw
from scenefw.core.errors import ConfigError
from scenefw.core.evidence import FittedSuperquadric
from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, GridSpec, Pose, TriangleMesh
from scenefw.fitting.vessels import VesselFit
from scenefw.kernels.cameras import stack_cameras
from scenefw.noise.stereo import Stereo
from scenefw.perception.completion.vessels import Vessels
from scenefw.perception.estimate.composition import with_vessels
from scenefw.perception.observation.observation import JointGeometry
from scenefw.perception.steps import Objects, ObjectSet
from scenefw.shapes.superquadric import Superquadric
from scenefw.shapes.vessel import Vessel

MUG = Vessel(0.04, 1.0, 1.0, 0.1, 0.004)
BOWL = Vessel(0.08, 0.4, 0.5, 0.06, 0.004)
CAN = Superquadric([0.04, 0.04, 0.05], [2, 2, 40])
PLACE = (0.05, 0.02)


def lens(eye, size=(320, 240)):
    width, height = size
    focal = 1.1 * width
    pose = look_at(eye, (*PLACE, 0.04))
    return Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2, pose)


def pictured(mesh, camera):
    """Depth (H, W) of a mesh that stands on the floor at `PLACE`, and where it is seen (H, W)."""
    corners = mesh.vertices + [*PLACE, -mesh.vertices[:, 2].min()]
    return cast_at(TriangleMesh(corners, mesh.faces), camera)


def scene_of(mesh, eye, resolution=64, size=(320, 240)):
    """The masks of an image of one object, and what that says."""
    camera = lens(eye, size)
    depth, shown = pictured(mesh, camera)
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    local = np.stack([(u - camera.cx) / camera.fx * depth, (v - camera.cy) / camera.fy * depth,
                      depth], axis=-1)  # fmt: skip
    pose = camera.T_world_camera
    points = local @ pose[:3, :3].T + pose[:3, 3]
    grid = GridSpec(resolution=resolution)
    centres = grid.centres().reshape(-1, 3)
    seen = (centres - pose[:3, 3]) @ pose[:3, :3]
    columns = np.round(seen[:, 0] / seen[:, 2] * camera.fx + camera.cx).astype(int)
    rows = np.round(seen[:, 1] / seen[:, 2] * camera.fy + camera.cy).astype(int)
    inside = (columns >= 0) & (columns < camera.width) & (rows >= 0) & (rows < camera.height)
    before = depth[np.where(inside, rows, 0), np.where(inside, columns, 0)]
    free = inside & (seen[:, 2] < before - grid.voxel_size)
    geometry = JointGeometry(points, grid, free.reshape(grid.shape), pose[:3, 3])
    return shown.astype(np.int32), geometry


def detected(masks, geometry, known=None, **settings):
    """The vessels that object 1 may be, beside superquadrics that explain it."""
    vessels = Vessels(VesselFit(), TOLERANCES, **settings)
    return vessels.detect(masks, geometry, [1], known or {})


def upright(shape, height):
    pose = Pose(np.array([*PLACE, height]), np.array([1.0, 0, 0, 0]))
    return FittedSuperquadric(shape.half_axes, shape.exponents, pose, 0.0, np.empty(0))


EYES = [(0.1, -0.7, 0.55), (-0.4, 0.4, 0.6)]


@pytest.mark.parametrize("size", [(320, 240), (640, 480)])
@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize("vessel", [MUG, BOWL])
def test_what_one_sees_into_becomes_hollow(vessel, eye, size):
    scene = scene_of(vessel.mesh(), eye, size=size)
    found = detected(*scene)
    assert list(found) == [1]
    assert found[1].shape.radius == pytest.approx(vessel.radius, rel=0.06)
    # A superquadric about it all is no better, as the far wall is seen through it
    about = Superquadric([vessel.radius] * 2 + [vessel.height / 2], [2, 2, 40])
    known = {1: upright(about, vessel.height / 2)}
    assert list(detected(*scene, known)) == [1]


def cut_in_two(scene, second):
    """Segments: 2 where a function of the points (..., 3) and the eye (3,) says so, elsewhere 1."""
    shown, geometry = scene
    return np.where(shown > 0, 1 + second(geometry.points, geometry.eye), 0).astype(np.int32)


def faces_its_axis(points, eye):
    """Where (...) walls about `PLACE` turn to the middle: there a view sees their inside."""
    return ((points - (*PLACE, 0)) * (eye - points))[..., :2].sum(axis=-1) < 0


@pytest.mark.parametrize("size", [(320, 240), (640, 480)])
@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize("vessel", [MUG, BOWL])
def test_inside_and_outside_are_one(vessel, eye, size):
    scene = scene_of(vessel.mesh(), eye, size=size)
    segments = cut_in_two(scene, faces_its_axis)
    assert np.bincount(segments.ravel())[1:].min() > 300
    joined = Vessels(VesselFit(), TOLERANCES).join(segments, scene[1])
    np.testing.assert_array_equal(joined, scene[0])


def test_all_pieces_of_an_inside_join_the_outside():
    """Whatever their numbers."""
    shown, geometry = scene_of(BOWL.mesh(), EYES[0])
    is_inside = faces_its_axis(geometry.points, geometry.eye)
    pieces = np.where(is_inside, np.where(geometry.points[..., 0] > PLACE[0], 3, 1), 2)
    segments = (pieces * shown).astype(np.int32)
    assert np.bincount(segments.ravel())[1:].min() > 300
    joined = Vessels(VesselFit(), TOLERANCES, min_width_ratio=0.5).join(segments, geometry)
    assert len(np.unique(joined)) == 2
    np.testing.assert_array_equal(joined > 0, shown > 0)


@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize(
    "second",
    [lambda points, _: points[..., 2] > 0.098, lambda points, _: points[..., 0] > PLACE[0]],
    ids=["top and side", "halves"],
)
def test_parts_of_a_can_stay_apart(eye, second):
    """Halves of a solid are merged as superquadrics, if at all."""
    scene = scene_of(CAN.mesh(24), eye)
    segments = cut_in_two(scene, second)
    assert np.bincount(segments.ravel())[1:].min() > 300
    np.testing.assert_array_equal(
        Vessels(VesselFit(), TOLERANCES).join(segments, scene[1]), segments
    )


def test_boxes_side_by_side_stay_apart():
    boxes = [
        trimesh.creation.box((0.06, 0.1, 0.08)).apply_translation((x, 0, 0))
        for x in (-0.031, 0.031)
    ]
    mesh = trimesh.util.concatenate(boxes)
    scene = scene_of(TriangleMesh(mesh.vertices, mesh.faces), EYES[0])
    segments = cut_in_two(scene, lambda points, _: points[..., 0] > PLACE[0])
    np.testing.assert_array_equal(
        Vessels(VesselFit(), TOLERANCES).join(segments, scene[1]), segments
    )


@pytest.mark.parametrize("eye", EYES)
def test_a_can_stays_solid_with_a_superquadric_and_without(eye):
    scene = scene_of(CAN.mesh(24), eye)
    assert detected(*scene, {1: upright(CAN, 0.05)}) == {}
    assert detected(*scene) == {}


def test_a_mug_from_the_side_stays_solid():
    assert detected(*scene_of(MUG.mesh(), (0.0, -0.9, 0.06))) == {}


def test_without_one_eye_and_with_few_points_nothing_is_hollow():
    masks, geometry = scene_of(MUG.mesh(), EYES[0])
    assert detected(masks, replace(geometry, eye=None)) == {}
    assert detected(masks, geometry, min_points=10**6) == {}


@pytest.mark.parametrize("vessel", [MUG, BOWL])
def test_a_wall_where_the_view_sees_through_is_none(vessel):
    masks, geometry = scene_of(vessel.mesh(), EYES[0])
    everything = np.ones_like(geometry.free)
    assert detected(masks, replace(geometry, free=everything)) == {}


def test_a_vessel_stays_whose_nearest_rim_is_seen_through():
    """More than a tenth of its wall is much less than a tenth of what is within it."""
    masks, geometry = scene_of(BOWL.mesh(), EYES[0])
    towards = geometry.eye[:2] - PLACE
    offsets = geometry.grid.centres()[..., :2] - PLACE
    is_near = offsets @ towards > 0.03 * np.linalg.norm(towards)
    assert list(detected(masks, replace(geometry, free=geometry.free | is_near))) == [1]


def test_pixels_between_two_surfaces_do_not_count():
    masks, geometry = scene_of(MUG.mesh(), EYES[0])
    assert list(detected(masks, replace(geometry, mixed=masks == 0))) == [1]
    assert detected(masks, replace(geometry, mixed=masks > 0)) == {}


def test_what_is_hollow_is_so_in_all_hypotheses():
    """The further one has an object more, as networks add hidden ones."""
    masks, geometry = scene_of(MUG.mesh(), EYES[0])
    about = upright(Superquadric([0.04, 0.04, 0.05], [2, 2, 40]), 0.05)
    first = ObjectSet(Objects(masks), {1: about}, evidence={1: object()})
    further = replace(first, superquadrics={1: about, 2: about})
    rough = ObjectSet(Objects(masks))  # no shape explains anything
    vessels = Vessels(VesselFit(), TOLERANCES)
    one, other = vessels.replace([first, further], geometry)
    assert list(one.vessels) == list(other.vessels) == [1]
    assert one.vessels[1] is other.vessels[1]
    assert one.superquadrics == {}
    assert other.superquadrics == {2: about}
    assert vessels.replace([rough, rough], geometry) == [rough, rough]
    unexplained = replace(first, superquadrics={})
    assert list(vessels.replace([unexplained], geometry)[0].vessels) == [1]
    unseen = replace(first, evidence={})
    assert vessels.replace([unseen], geometry)[0].superquadrics == {1: about}


def test_what_lies_in_a_vessel_keeps_its_voxels():
    masks, geometry = scene_of(BOWL.mesh(), EYES[0])
    found, grid = detected(masks, geometry), geometry.grid
    ball = np.linalg.norm(grid.centres() - [*PLACE, 0.035], axis=-1) - 0.03
    tsdf = np.minimum(ball, grid.truncation).astype(np.float32)
    instances = np.where(ball < 0, 2, 0).astype(np.int32)
    _, labels = with_vessels(tsdf, instances, found, grid)
    assert np.array_equal(labels == 2, instances == 2)
    assert (labels == 1).sum() > 100


def test_a_piece_of_a_large_one_is_none():
    masks, geometry = scene_of(BOWL.mesh(), EYES[0])
    x, y, _ = np.moveaxis(geometry.points, -1, 0)
    narrow = masks * (np.abs(x - PLACE[0]) < 0.02) * (y > PLACE[1])
    assert detected(narrow, geometry) == {}


def test_a_vessel_that_ends_beyond_the_grid_is_none():
    masks, geometry = scene_of(MUG.mesh(), EYES[0])
    small = GridSpec(resolution=64, extent=0.2, lower=(PLACE[0] - 0.2, PLACE[1] - 0.1, -0.02))
    free = np.zeros(small.shape, bool)
    assert detected(masks, replace(geometry, grid=small, free=free)) == {}


@pytest.mark.parametrize("resolution", [64, 96])
def test_volumes_have_a_lid_and_others_stay(resolution):
    masks, geometry = scene_of(BOWL.mesh(), EYES[0], resolution)
    found, grid = detected(masks, geometry), geometry.grid
    other = np.linalg.norm(grid.centres() - [-0.2, 0.1, 0.05], axis=-1) - 0.05
    tsdf = np.minimum(other, grid.truncation).astype(np.float32)
    instances = np.where(tsdf < 0, 2, 0).astype(np.int32)
    made, labels = with_vessels(tsdf, instances, found, grid)
    assert set(np.unique(labels)) == {0, 1, 2}
    assert np.array_equal(labels == 2, instances == 2)
    filled = (labels == 1).sum() * grid.voxel_size**3
    t = np.linspace(0, 1, 2001)
    true = np.pi * np.mean((0.08 * (0.4 + 0.6 * t**0.5)) ** 2) * 0.06
    assert filled == pytest.approx(true, rel=0.15)
    assert np.array_equal(made < 0, labels > 0)


@pytest.mark.parametrize(
    "wrong", [{"min_gain": 1.5}, {"points": 3}, {"edge_pixels": -1}, {"min_depth": -0.1}]
)
def test_bad_settings(wrong):
    with pytest.raises(ConfigError, match=f"^{next(iter(wrong))} = "):
        Vessels(VesselFit(), TOLERANCES, **wrong)


HOLLOW = "ycb_video_frame/024_bowl ycb_video_frame/025_mug pybullet_urdf/bowl pybullet_urdf/mug"
SOLID = "ycb_video_frame/005_tomato_soup_can ycb_video_frame/004_sugar_box object_sim/apple"
_NOISE = Stereo(waves=0.05, window=2, edges=1.0, shadows=0.7)


def off(scene, camera, mesh):
    """Mean distance (mm) from the true surface to that of all objects, and back."""
    truth = TriangleMesh(mesh.vertices + [*PLACE, -mesh.vertices[:, 2].min()], mesh.faces)
    own = camera.T_world_camera @ np.linalg.inv(scene.estimate.frame.camera.T_world_camera)
    found = trimesh.util.concatenate(
        [
            trimesh.Trimesh(item.mesh.vertices @ own[:3, :3].T + own[:3, 3], item.mesh.faces)
            for item in scene.objects
        ]
    )
    sides = [trimesh.Trimesh(truth.vertices, truth.faces), found]
    points = [trimesh.sample.sample_surface(side, 6000, seed=0)[0] for side in sides]
    ways = [cKDTree(points[k]).query(points[1 - k])[0].mean() for k in (0, 1)]
    return 500 * sum(ways)


@pytest.mark.exhaustive
def test_real_bowls_and_mugs_are_met_and_solid_things_stay(real_data, capsys):
    """Pictures of scanned meshes with noise of a stereo camera, from two sides each."""
    models = {
        name: scenefw.load("reconstruction", "reconstructor.samples=1", *more)
        for name, more in (("hollow", []), ("solid", ["reconstructor.hollow=null"]))
    }
    rng = np.random.default_rng(0)
    rows = {}
    for kind, names in (("hollow", HOLLOW), ("solid", SOLID)):
        for name in names.split():
            read = trimesh.load(Path(real_data) / "meshes" / f"{name}.ply", force="mesh")
            middle = read.bounds.mean(axis=0) * [1, 1, 0]
            mesh = TriangleMesh(np.asarray(read.vertices) - middle, np.asarray(read.faces))
            for _ in range(2):
                way, rise = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(28, 55))
                flat = 0.75 * np.cos(rise)
                eye = (flat * np.cos(way), flat * np.sin(way), 0.75 * np.sin(rise))
                camera = lens(eye, (640, 480))
                depth, shown = pictured(mesh, camera)
                seeds = torch.tensor([int(rng.integers(2**40))])
                image = torch.from_numpy(np.where(depth < 3, depth, 0))[None]
                noisy = _NOISE.apply(image, stack_cameras([camera]), seeds)[0].numpy()
                inner = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
                scenes = {
                    key: model.predict(noisy, inner, mask=(shown & (noisy > 0)).astype(np.int32))
                    for key, model in models.items()
                }
                hollow = [type(i.placed.shape) is Vessel for i in scenes["hollow"].objects
                          if i.placed]  # fmt: skip
                errors = [off(scenes[key], camera, mesh) for key in ("hollow", "solid")]
                rows.setdefault((kind, name), []).append([any(hollow), *errors])
    with capsys.disabled():
        for (_, name), values in rows.items():
            share, with_it, without = np.mean(values, axis=0)
            print(
                f"\n{name}: hollow in {share:.0%}; {with_it:.1f} mm, without {without:.1f}", end=""
            )
    for kind, share in (("hollow", 0.7), ("solid", 0.0)):
        found = np.concatenate([values for (k, _), values in rows.items() if k == kind])
        assert found[:, 0].mean() >= share if share else not found[:, 0].any()
    found = np.concatenate([values for (k, _), values in rows.items() if k == "hollow"])
    assert found[:, 1].mean() < 0.7 * found[:, 2].mean()
