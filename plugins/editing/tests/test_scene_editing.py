import numpy as np
import pytest
from tests.unit.perception.edited_scenes import block, scene

from scenefw.core.errors import InputError
from scenefw.core.geometry import transform_points
from scenefw.core.types import PlacedShape, Pose
from scenefw.perception.estimate.contacts import hovers, overlaps
from scenefw.shapes.moments import moments
from scenefw.shapes.superquadric import Superquadric
from scenefw_editing import scene_editing as editing
from scenefw_editing.contact_words import contact_words
from scenefw_editing.edit_words import USAGES, edited


@pytest.fixture(scope="module")
def known():
    return scene()


def volume(item):
    return moments(item.mesh).volume


def lowest(item):
    return item.mesh.vertices[:, 2].min()


def test_a_pile_at_rest_has_no_warning(known):
    assert contact_words(known.objects) == []


def test_removal_leaves_the_others_as_they_are(known):
    left = editing.removed(known.objects, 2)
    assert [item.id for item in left] == [1, 3]
    assert left[0] is known.objects[0]
    after = editing.with_objects(known, left)
    assert set(np.unique(after.instances)) == {0, 1, 3}
    assert set(np.unique(after.masks)) == {0, 1, 3}
    assert (after.tsdf[known.instances == 2] > 0).mean() > 0.9
    assert after.volumes == {}
    assert after.details.keys() == {"seed", "grid"}
    assert set(np.unique(known.masks)) == {0, 1, 2, 3}  # nothing of the scene before changed


def test_nothing_edited_is_the_scene_itself(known):
    assert editing.with_objects(known, tuple(known.objects)) is known


def test_a_move_takes_mesh_pose_and_shape_along(known):
    by = (0.1, -0.05, 0.02)
    item = editing.named(editing.moved_by(known.objects, 2, by), 2)
    before = known.objects[1]
    np.testing.assert_allclose(item.mesh.vertices, before.mesh.vertices + by)
    np.testing.assert_allclose(item.pose.position, before.pose.position + by)
    np.testing.assert_allclose(item.placed.pose.position, (0.1, -0.05, 0.15))
    reached = item.placed.mesh().vertices
    np.testing.assert_allclose(reached, item.mesh.vertices, atol=1e-9)


def test_a_turn_is_about_the_centre_of_mass(known):
    turned = editing.named(editing.moved_by(known.objects, 3, turn=90), 3)
    before = known.objects[2]
    np.testing.assert_allclose(turned.pose.position, before.pose.position, atol=1e-9)
    np.testing.assert_allclose(np.ptp(turned.mesh.vertices, axis=0), (0.04, 0.06, 0.08), atol=1e-9)
    lying = editing.named(editing.moved_by(known.objects, 3, turn=90, axis=(0, 2, 0)), 3)
    np.testing.assert_allclose(np.ptp(lying.mesh.vertices, axis=0), (0.08, 0.04, 0.06), atol=1e-9)


@pytest.mark.parametrize("label", [2, 3])
def test_scaling_keeps_what_it_stands_on(known, label):
    before = editing.named(known.objects, label)
    after = editing.named(editing.scaled(known.objects, label, 1.5), label)
    assert volume(after) == pytest.approx(1.5**3 * volume(before))
    assert lowest(after) == pytest.approx(lowest(before))
    np.testing.assert_allclose(after.extents, 1.5 * np.array(before.extents))
    if before.placed:
        np.testing.assert_allclose(after.placed.shape.half_axes, (0.075, 0.06, 0.045))
        to_shape = np.linalg.inv(after.placed.pose.matrix)
        local = transform_points(to_shape, after.mesh.vertices)
        np.testing.assert_allclose(after.placed.shape.value(local), 1, atol=1e-6)


def test_swapped_shapes_stand_where_the_other_stood(known):
    after = editing.swapped(known.objects, 1, 3)
    assert [item.id for item in after] == [1, 2, 3]
    for here, there in ((0, 2), (2, 0)):
        was, now = known.objects[here], after[here]
        assert volume(now) == pytest.approx(volume(known.objects[there]))
        assert lowest(now) == pytest.approx(lowest(was), abs=1e-9)
        np.testing.assert_allclose(now.pose.position[:2], was.pose.position[:2], atol=1e-9)
        np.testing.assert_allclose(np.abs(now.pose.rotation), np.abs(was.pose.rotation), atol=1e-6)
    assert after[0].placed is None
    assert after[2].placed.shape is known.objects[0].placed.shape
    again = editing.swapped(after, 1, 3)
    np.testing.assert_allclose(again[0].mesh.vertices, known.objects[0].mesh.vertices, atol=1e-9)


def test_an_added_superquadric_stands_on_the_floor(known):
    placed = editing.superquadric((0.04, 0.03, 0.02), (20, 20, 2), (-0.2, 0.1, None), turn=30)
    after = editing.added(known.objects, placed)
    new = after[-1]
    assert new.id == 4
    assert lowest(new) == pytest.approx(0)
    assert volume(new) == pytest.approx(placed.shape.volume(), rel=0.01)
    np.testing.assert_allclose(new.pose.position, (-0.2, 0.1, 0.02), atol=1e-9)
    along = new.placed.pose.rotation[:, 0]
    np.testing.assert_allclose(along, (np.cos(np.pi / 6), 0.5, 0), atol=1e-9)
    assert contact_words(after) == []


def test_joined_scenes_have_ids_of_their_own(known):
    after = editing.joined(known.objects, known.objects, (0.0, 0.6, 0.0))
    assert [item.id for item in after] == [1, 2, 3, 4, 5, 6]
    made = editing.with_objects(known, after)
    grid = made.grid
    assert set(np.unique(made.instances)) == set(range(7))
    upper = np.array(grid.lower) + grid.extent
    for item in after:  # the grid has grown, its voxels haven't
        assert (item.mesh.vertices > grid.lower).all()
        assert (item.mesh.vertices < upper).all()
    assert grid.voxel_size == pytest.approx(known.grid.voxel_size, rel=0.05)
    inside = (made.instances == 4).sum() * grid.voxel_size**3
    assert inside == pytest.approx(volume(after[3]), rel=0.3)


def test_overlaps_are_told_with_numbers(known):
    (found,) = overlaps(editing.moved_by(known.objects, 2, (0, 0, -0.03)))
    assert (found.first, found.second) == (1, 2)
    assert found.depth == pytest.approx(0.03, abs=0.003)
    assert found.volume == pytest.approx(0.1 * 0.08 * 0.03, rel=0.1)
    (floor,) = overlaps(editing.moved_by(known.objects, 3, (0, 0, -0.012)))
    assert (floor.first, floor.second, floor.depth) == (3, 0, pytest.approx(0.012))


def test_what_hovers_is_told_with_numbers(known):
    (one,) = hovers(editing.moved_by(known.objects, 2, (0.02, 0, 0.04)))
    assert (one.id, one.below, one.gap) == (2, 1, pytest.approx(0.04, abs=1e-3))
    (alone,) = hovers(editing.removed(known.objects, 1))
    assert (alone.id, alone.below, alone.gap) == (2, 0, pytest.approx(0.1, abs=1e-3))
    beside = editing.moved_by(known.objects, 2, (0, 0.3, 0))
    assert contact_words(beside) == ["object 2 hovers 100 mm above the floor"]


def test_what_pierces_from_above_carries_nothing(known):
    raised = editing.moved_by(known.objects, 1, (0, 0, 0.02))  # into the one on it
    found = hovers(raised)
    assert [(one.id, one.below) for one in found] == [(1, 0)]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("remove 2", [1, 3]),
        ("move 1 0.1 0 -0.1", [1, 2, 3]),
        ("turn 1 45", [1, 2, 3]),
        ("turn 1 45 1 0 0", [1, 2, 3]),
        ("scale 1 0.5", [1, 2, 3]),
        ("swap 1 2", [1, 2, 3]),
        ("add 2", [1, 2, 3, 4]),
        ("add other.json 2 0 0 0.3", [1, 2, 3, 4]),
        ("add superquadric 0.1 0.1 0.1 2 2 2 0 0", [1, 2, 3, 4]),
        ("add superquadric 0.1 0.1 0.1 2 2 2 0 0 0.5 30", [1, 2, 3, 4]),
        ("join other.json", [1, 2, 3, 4, 5, 6]),
    ],
)
def test_words_do_what_they_say(known, words, expected):
    after = edited(known.objects, words, lambda name: {"other.json": known}[name])
    assert [item.id for item in after] == expected
    assert any(now is not was for now, was in zip(after, known.objects, strict=False)) or len(
        after
    ) > len(known.objects)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("remove 7", "edit 'remove 7': there is no object 7; the scene has 1, 2, 3"),
        ("remove", "expected remove ID"),
        ("remove one", "expected remove ID"),
        ("remove 1.5", "expected remove ID"),
        ("rmove 1", "there is no edit 'rmove 1'; did you mean remove?"),
        ("", "there is no edit ''; give one of remove, move"),
        ("move 1 2", "expected move ID DX DY DZ"),
        ("move 1 nan 0 0", "the move is .*: expected 3 numbers"),
        ("move 1 5000 0 0", "object 1 would be 5e.03 m away; positions are in metres"),
        ("turn 1 90 0 0 0", "expected degrees and an axis, not 0"),
        ("turn 1 inf", "expected degrees"),
        ("scale 1 0", "expected a number from"),
        ("scale 1 -2", "expected a number from"),
        ("swap 2 2", "object 2 can't be swapped with itself"),
        ("add superquadric 0.1 0.1 0.1 2 2 0 0", "expected add"),
        ("add superquadric 0.1 0.1 -0.1 2 2 2 0 0", "half_axes"),
        ("add superquadric 0.1 0.1 0.1 2 2 0.5 0 0", "exponents"),
        ("join 'x", "there is no edit"),
    ],
)
def test_bad_edits_end_in_one_line(known, words, said):
    with pytest.raises(InputError, match=said) as error:
        edited(known.objects, words, lambda _: known)
    assert "\n" not in str(error.value)


def test_every_edit_is_explained():
    assert set(USAGES) == {"remove", "move", "turn", "scale", "swap", "add", "join"}


def test_a_shape_without_a_size_becomes_a_mesh(known):
    class Lump:
        def mesh(self):
            return block((0.1, 0.1, 0.1), (0, 0, 0)).mesh()

        def volume(self):
            return 0.001

    pose = Pose(np.array([0, 0.3, 0.05]), np.array([1.0, 0, 0, 0]))
    after = editing.scaled(editing.added(known.objects, PlacedShape(Lump(), pose)), 4, 2.0)
    assert after[-1].placed is None
    assert volume(after[-1]) == pytest.approx(0.008, rel=0.1)
    assert isinstance(after[0].placed.shape, Superquadric)
