"""Things are closed, exact, repeatable, and apart between the parts of the data."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from scenefw import registry
from scenefw.core.errors import ConfigError
from scenefw.core.types import PlacedShape, Pose
from scenefw.shapes.solid_mesh import closed
from scenefw_things.shapes.families import FAMILIES
from scenefw_things.shapes.library import PARTS
from scenefw_things.shapes.source import Things, as_solid
from scenefw_things.shapes.thing import Thing


@pytest.fixture(scope="module")
def library():
    return registry.build("shape", "things").library


def drawn(name, seed):
    rng = np.random.default_rng(seed)
    values = [float(np.float32(rng.uniform(*limits))) for limits in FAMILIES[name].limits.values()]
    return Thing(name, tuple(values), seed)


@pytest.mark.parametrize("name", FAMILIES)
def test_surface_is_closed_and_holds_the_parts(name):
    thing = drawn(name, 0)
    mesh = trimesh.Trimesh(thing.mesh.vertices, thing.mesh.faces, process=False)
    volumes = [ConvexHull(part.corners).volume for part in thing.parts]
    assert closed(thing.mesh)
    assert mesh.is_watertight
    assert max(volumes) - 1e-12 <= mesh.volume <= sum(volumes) + 1e-12
    assert mesh.bounds[0, 2] == pytest.approx(0, abs=1e-9)
    corners = np.concatenate([part.corners for part in thing.parts])
    np.testing.assert_allclose(mesh.bounds, [corners.min(axis=0), corners.max(axis=0)], atol=1e-9)
    assert 0.02 < np.ptp(corners, axis=0).max() < 0.6


@pytest.mark.parametrize("name", sorted(set(FAMILIES) - {"bullet_compound"}))  # its parts have gaps
def test_is_in_one_piece(name):
    mesh = drawn(name, 2).mesh
    pieces = trimesh.Trimesh(mesh.vertices, mesh.faces).split(only_watertight=False)
    volumes = sorted(abs(piece.volume) for piece in pieces)
    outer = [piece for piece in pieces if piece.volume > 0]
    assert len(outer) == 1, volumes


@pytest.mark.parametrize("name", ["mug", "studded_brick", "toy_animal", "compound"])
def test_distances_are_those_of_open3d(name):
    open3d = pytest.importorskip("open3d")
    thing = drawn(name, 3)
    scene = open3d.t.geometry.RaycastingScene()
    vertices, faces = thing.mesh.vertices.astype(np.float32), thing.mesh.faces.astype(np.uint32)
    scene.add_triangles(open3d.core.Tensor(vertices), open3d.core.Tensor(faces))
    low, high = vertices.min(axis=0) - 0.02, vertices.max(axis=0) + 0.02
    points = np.random.default_rng(300).uniform(low, high, (300, 3))
    tensor = open3d.core.Tensor(points.astype(np.float32))
    expected = scene.compute_signed_distance(tensor, nsamples=5).numpy()
    np.testing.assert_allclose(thing.signed_distances(points), expected, atol=2e-6)


def test_things_are_rebuilt_bit_for_bit_from_what_is_stored():
    for name in FAMILIES:
        thing = drawn(name, 4)
        numbers = np.array(thing.parameters, dtype=np.float32)
        again = Thing(str(name), tuple(float(value) for value in numbers), thing.seed)
        assert len(again.parts) == len(thing.parts)
        for part, other in zip(thing.parts, again.parts, strict=True):
            assert part.corners.tobytes() == other.corners.tobytes()
        assert again.name == thing.name


def test_parts_of_the_data_are_apart(library):
    draws = {
        part: [library.thing(np.random.default_rng(i), part) for i in range(300)] for part in PARTS
    }
    for part, things in draws.items():
        assert {thing.family for thing in things} <= set(library.families[part])
        for other in set(PARTS) - {part}:
            assert set(library.families[part]) - set(library.families[other])
    for name in FAMILIES:
        limits = next(iter(FAMILIES[name].limits.values()))
        cells = {}
        for part, things in draws.items():
            at = [
                (thing.parameters[0] - limits[0]) / (limits[1] - limits[0])
                for thing in things
                if thing.family == name
            ]
            cells[part] = {int(min(9.999, 10 * place + 1e-4)) for place in at if _inner(place)}
        for part in PARTS:
            for other in PARTS:
                assert part == other or not cells[part] & cells[other]


def _inner(place):
    """Whether a place isn't on the border of two tenths, where float32 may round either way."""
    return abs(10 * place - round(10 * place)) > 1e-3


def test_same_seed_gives_the_same_thing(library):
    one, two = (library.thing(np.random.default_rng(7), "train") for _ in range(2))
    assert one == two
    assert one != library.thing(np.random.default_rng(8), "train")


def test_every_family_is_in_a_part(library):
    listed = {name for names in library.families.values() for name in names}
    assert listed == set(FAMILIES) - {"bullet_compound"}


def test_compounds_of_bullet_are_dealt_out_by_number():
    source = registry.build("shape", "bullet_compounds")
    numbers = {
        part: {
            int(source.library.thing(np.random.default_rng(i), part).parameters[0])
            for i in range(200)
        }
        for part in PARTS
    }
    for part in PARTS:
        for other in set(PARTS) - {part}:
            assert len(numbers[part] & numbers[other]) <= 2  # on the border of two bands


@pytest.mark.parametrize("families", [{"train": ["teapot"]}, {"training": ["can"]}, {"train": []}])
def test_wrong_lists_are_told(families):
    with pytest.raises(ConfigError, match="expected a list for train, val, test, final"):
        Things(families)


def test_a_part_without_things_is_told(library):
    with pytest.raises(ConfigError, match=r"no things for all; give shape\.families\.all"):
        library.thing(np.random.default_rng(0), "all")


def test_a_solid_is_the_thing_in_its_principal_axes():
    thing = drawn("hammer", 5)
    shape = as_solid(thing)
    mesh = PlacedShape(shape, Pose(np.zeros(3), np.array([1.0, 0, 0, 0]))).mesh()
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces)
    np.testing.assert_allclose(solid.center_mass, 0, atol=1e-6)
    assert solid.volume == pytest.approx(
        trimesh.Trimesh(thing.mesh.vertices, thing.mesh.faces).volume, rel=1e-4
    )
    assert len(shape.parts) == len(thing.parts)
