"""Objects completed by shells, which a stand-in for the network takes from the true boxes."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
import trimesh
from tests.unit.perception.observations import observation_of
from tests.unit.perception.synthetic import Box, camera_at, frame_of

from scenefw.core.errors import ConfigError
from scenefw.core.evidence import FittedSuperquadric
from scenefw.core.types import GridSpec, Pose
from scenefw.kernels.cameras import camera_of
from scenefw.perception.completion.support import extend_shells
from scenefw.perception.estimate.assembly import SceneAssembly
from scenefw.perception.observation.obstacles import ObstacleRegion
from scenefw.perception.observation.views import Views
from scenefw.perception.steps import Objects, ObjectSet
from scenefw.shapes.object_shell import ENTRY, EXIT
from scenefw_things.shells.batches import ShellPrediction
from scenefw_things.shells.crops import CropShape
from scenefw_things.shells.learned_shapes import LearnedShapes

BOXES = (
    Box((-0.20, -0.04, 0.0), (-0.10, 0.06, 0.12)),
    Box((0.02, -0.05, 0.0), (0.14, 0.05, 0.05)),
    Box((0.05, 0.08, 0.0), (0.053, 0.18, 0.2)),  # a sheet of 3 mm
)
GRID = GridSpec()


def metadata(**changes):
    """Of weights that learnt from crops of the usual shape."""
    return {
        "crops": {"resolution": 96, "margin": 1.8, "min_width": 0.14, "min_pixels": 60} | changes
    }


METADATA = metadata()


class TrueShells(torch.nn.Module):
    """Gives the shells of boxes; each code moves its object's far side by its first number (cm)."""

    latent_size = 3

    def __init__(self, boxes, entry_error=0.0, exit_error=0.0, hollow_draws=False):
        super().__init__()
        self.boxes, self.entry_error, self.exit_error = boxes, entry_error, exit_error
        self.hollow_draws = hollow_draws
        self.weight = torch.nn.Parameter(torch.zeros(1))
        self.codes, self.crops = {}, None

    def sample(self, crops, codes):
        self.crops = self.crops or crops  # those of all objects come first
        lenses = self.crops.cameras.intrinsics.tolist()
        rows = [lenses.index(lens) for lens in crops.cameras.intrinsics.tolist()]
        self.codes |= {row: codes[:, n] for n, row in enumerate(rows)}
        shells = [self.shell(camera_of(crops.cameras, n), self.boxes[row])
                  for n, row in enumerate(rows)]  # fmt: skip
        amodal, depths = (torch.from_numpy(np.stack(x)) for x in zip(*shells, strict=True))
        count = len(codes)
        depths = depths.repeat(count, 1, 1, 1)
        depths[:, 1] += 0.01 * codes[..., 0].reshape(-1, 1, 1)
        depths[:, ENTRY] += self.entry_error
        depths[:, EXIT] += self.exit_error
        amodal = torch.where(amodal, 5.0, -5.0).repeat(count, 1, 1)
        hollow = torch.full_like(amodal, -5.0)
        hollow[len(rows) :] *= -1 if self.hollow_draws else 1
        return ShellPrediction(amodal, hollow, depths.float())

    @staticmethod
    def shell(camera, box):
        v, u = np.indices((camera.height, camera.width))
        local = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy,
                          np.ones(u.shape)], -1)  # fmt: skip
        directions = local @ camera.T_world_camera[:3, :3].T
        eye = camera.T_world_camera[:3, 3]
        a, b = ((np.array(x) - eye) / directions for x in (box.lower, box.upper))
        enter, leave = np.minimum(a, b).max(-1), np.maximum(a, b).min(-1)
        return enter < leave, np.stack([enter, leave, enter, leave])


def view_of(boxes=BOXES, size=(320, 240), noise=0.0):
    camera = camera_at(size=size)
    frame = replace(frame_of(camera, boxes, noise=noise), camera=camera)
    return observation_of(frame, GRID), frame.labels


def completed(boxes=BOXES, samples=1, explained=(), size=(320, 240), noise=0.0,
              shown=None, min_pixels=60, **settings):  # fmt: skip
    view, labels = view_of(shown or boxes, size, noise)
    model = TrueShells(boxes, **settings)
    checkpoint = SimpleNamespace(model=model, metadata=metadata(min_pixels=min_pixels))
    method = LearnedShapes(checkpoint)
    shape = GRID.shape
    rough = Objects(labels, np.full(shape, GRID.truncation, np.float32), np.zeros(shape, np.int32))
    sets = [ObjectSet(rough, dict.fromkeys(explained, "a superquadric"))] * samples
    return method.beside(sets, view, torch.Generator().manual_seed(1)), view, model


@pytest.mark.parametrize("size", [(320, 240), (640, 480)])
def test_objects_are_the_true_boxes(size):
    (hypothesis,), view, _ = completed(size=size)
    scene = next(SceneAssembly().assemble([hypothesis], view, {}))
    assert [item.id for item in scene.objects] == [1, 2, 3]
    for item, box in zip(scene.objects, BOXES, strict=True):
        body = trimesh.Trimesh(item.mesh.vertices, item.mesh.faces, process=False)
        assert body.is_watertight
        np.testing.assert_allclose(body.bounds, [box.lower, box.upper], atol=0.006)
        volume = np.prod(np.subtract(box.upper, box.lower))
        assert body.volume == pytest.approx(volume, rel=0.1 if item.id < 3 else 1.5)


def test_a_thin_object_stays_though_no_voxel_shows_it():
    (hypothesis,), view, _ = completed()
    scene = next(SceneAssembly().assemble([hypothesis], view, {}))
    assert not (scene.instances == 3).any()
    assert scene.objects[2].mesh.vertices[:, 2].max() > 0.18
    assert (scene.masks == 3).any()


@pytest.mark.parametrize("size", [(320, 240), (640, 480)])
def test_pixels_without_depth_are_objects_where_colour_says_so_and_nobody_marked_them(size):
    (hypothesis,), view, _ = completed(BOXES[:2], size=size)
    masks = hypothesis.objects.masks
    gap = (masks == 1) & (np.arange(size[0]) > np.median(np.nonzero(masks == 1)[1]))
    colour = np.array([[120, 120, 120], [200, 40, 30], [30, 60, 190]], np.uint8)[masks]
    image = replace(view.image, colour=colour, depth=np.where(gap, np.float32(0), view.depth))
    rough = replace(hypothesis.objects, masks=np.where(gap, 0, masks).astype(np.int32))
    for marks, ratio in ((None, 1), (rough.masks, 0)):
        gappy = replace(view, image=image, masks=marks)
        scene = next(SceneAssembly().assemble([replace(hypothesis, objects=rough)], gappy, {}))
        assert (scene.masks[gap] == 1).mean() == pytest.approx(ratio, abs=0.05)
        np.testing.assert_array_equal(scene.masks[masks == 2], 2)


@pytest.mark.parametrize(
    "box",
    [
        Box((0.05, 0.08, 0.0), (0.053, 0.1, 0.03)),  # a fragment
        Box((0.05, 0.6, 0.0), (0.15, 0.7, 0.2)),  # beyond the cube
    ],
)
def test_fragments_and_what_lies_beyond_the_cube_are_left_out(box):
    (hypothesis,), view, _ = completed((*BOXES[:2], box))
    assert (hypothesis.objects.masks == 3).any()
    scene = next(SceneAssembly().assemble([hypothesis], view, {}))
    assert [item.id for item in scene.objects] == [1, 2]


def test_the_visible_surface_stays_within_the_noise():
    (hypothesis,), view, model = completed(entry_error=0.02, noise=0.001)
    crops = model.crops
    for label, shell in hypothesis.shells.items():
        visible = crops.visible[label - 1].numpy()
        measured = crops.depth[label - 1].double().numpy()
        reach = 3 * view.noise.at(measured)
        off = np.abs(shell.depths[ENTRY] - measured)
        assert (off[visible] <= reach[visible] + 1e-9).all()
        assert (reach[visible] < 0.01).all()


def test_nothing_lies_before_what_was_measured():
    """The network takes the floor beside each box for the box, and lets it begin 5 cm earlier."""
    boxes = tuple(
        Box(tuple(np.subtract(b.lower, (0.03, 0.03, 0))), tuple(np.add(b.upper, (0.03, 0.03, 0))))
        for b in BOXES[:2]
    )
    view, labels = view_of(BOXES[:2])
    model = TrueShells(boxes, -0.05)
    method = LearnedShapes(SimpleNamespace(model=model, metadata=METADATA))
    (hypothesis,) = method.beside([ObjectSet(Objects(labels), {})], view, torch.Generator())
    for label, shell in hypothesis.shells.items():
        measured = model.crops.depth[label - 1].double().numpy()
        assert (shell.depths[ENTRY][shell.amodal] >= measured[shell.amodal] - 1e-6).all()
        box = BOXES[label - 1]
        top = shell.mesh(0.003).vertices[:, 2].max()
        assert top == pytest.approx(box.upper[2], abs=0.006)


def test_what_is_visible_is_as_thick_as_its_mesh_can_show():
    """The network lets each box end before it begins."""
    (hypothesis,), _, model = completed(exit_error=-0.3)
    for label, shell in hypothesis.shells.items():
        visible = model.crops.visible[label - 1].numpy()
        assert shell.amodal[visible].mean() > 0.95  # the network leaves out edges
        thickness = (shell.depths[EXIT] - shell.depths[ENTRY])[visible & shell.amodal]
        assert thickness.min() == pytest.approx(2 * shell.voxel, rel=0.05)


@pytest.mark.parametrize("hollow_draws", [False, True])
def test_a_solid_is_one_in_all_hypotheses(hollow_draws):
    sets, _, _ = completed(samples=3, hollow_draws=hollow_draws)
    assert not any(shell.hollow.any() for item in sets for shell in item.shells.values())


def test_no_object_is_longer_than_its_crop_is_wide():
    (hypothesis,), _, model = completed(exit_error=5.0)
    for label, shell in hypothesis.shells.items():
        visible = model.crops.depth[label - 1][model.crops.visible[label - 1]].numpy()
        camera = camera_of(model.crops.cameras, label - 1)
        width = np.median(visible) * camera.width / camera.fx
        assert shell.depths[EXIT][shell.amodal].max() <= np.median(visible) + 1.01 * width


def test_the_first_hypothesis_is_the_best_guess_and_others_follow_their_codes():
    sets, _, model = completed(samples=3)
    for number, hypothesis in enumerate(sets):
        for label, shell in hypothesis.shells.items():
            first = sets[0].shells[label]
            moved = shell.depths[1] - first.depths[1]
            codes = model.codes[label - 1]
            assert (codes[0] == 0).all()
            expected = 0.01 * float(codes[number, 0])
            thinner = np.minimum(*(np.subtract(*s.depths[[EXIT, ENTRY]]) for s in (shell, first)))
            is_thick = shell.amodal & first.amodal & (thinner > 2.1 * shell.voxel)
            assert is_thick.sum() > 50
            np.testing.assert_allclose(moved[is_thick], expected, atol=1e-6)
    again, _, _ = completed(samples=3)
    np.testing.assert_array_equal(again[2].shells[1].depths, sets[2].shells[1].depths)


def test_further_hypotheses_are_drawn_where_one_is_asked_for():
    sets, view, model = completed(samples=3)
    sets = [extend_shells(hypothesis, view) for hypothesis in sets]
    assert {row: len(codes) for row, codes in model.codes.items()} == {0: 1, 1: 1, 2: 1}
    assert sets[2].shells[2].amodal.any()
    assert {row: len(codes) for row, codes in model.codes.items()} == {0: 1, 1: 3, 2: 1}


def test_superquadrics_stay_beside_shells():
    sets, _, _ = completed(samples=2, explained=(2, 3))
    assert [set(s.shells) for s in sets] == [{1, 2, 3}] * 2
    assert [set(s.superquadrics) for s in sets] == [{2, 3}] * 2


class Hulls:
    """Stands in for a calibration: more is to be expected of hulls, or of superquadrics."""

    names = ("hull",)

    def __init__(self, of_hulls):
        self.of_hulls = of_hulls

    def __call__(self, numbers):
        (hull,) = numbers[0]
        return [self.of_hulls if hull else 0.5]


@pytest.mark.parametrize(("of_hulls", "placed"), [(0.9, False), (0.1, True)])
def test_the_shape_of_which_more_is_to_be_expected_is_the_objects(of_hulls, placed):
    """Superquadrics reach 4 cm beyond the boxes; shells end with them."""
    sets, view, _ = completed(BOXES[:2], samples=2)
    large = {label: superquadric(box, 0.04) for label, box in enumerate(BOXES[:2], start=1)}
    sets = [replace(hypothesis, superquadrics=large) for hypothesis in sets]
    for scene in SceneAssembly(Hulls(of_hulls), carve=False).assemble(sets, view, {}):
        for item, box in zip(scene.objects, BOXES[:2], strict=True):
            assert (item.placed is not None) == placed
            assert item.confidence == (0.5 if placed else 0.9)
            size = np.ptp(item.mesh.vertices, axis=0)[:2] - np.subtract(box.upper, box.lower)[:2]
            np.testing.assert_allclose(size, 0.08 if placed else 0.0, atol=0.012)
            inside = scene.grid.centres()[scene.instances == item.id]
            width = np.ptp(inside, axis=0)[:2] - np.subtract(box.upper, box.lower)[:2]
            np.testing.assert_allclose(width, 0.08 if placed else 0.0, atol=0.03)


def superquadric(box, wider):
    lower, upper = np.array(box.lower), np.array(box.upper)
    half_axes = (upper - lower) / 2 + (wider, wider, 0)
    pose = Pose((lower + upper) / 2, np.array([1.0, 0, 0, 0]))
    return FittedSuperquadric(half_axes, np.full(3, 50.0), pose, 0.0, np.empty(0))


def test_the_network_sees_colour_and_obstacles():
    view, labels = view_of()
    colour = np.zeros((*labels.shape, 3), np.uint8)
    colour[labels == 1] = (255, 0, 102)
    wall = labels == 3
    view = replace(
        view,
        image=replace(view.frame, colour=colour),
        workspace=SimpleNamespace(obstacles=[ObstacleRegion("wall", wall)]),
    )
    model = TrueShells(BOXES[:2])
    method = LearnedShapes(SimpleNamespace(model=model, metadata=METADATA))
    masks = np.where(wall, 0, labels).astype(np.int32)
    method.beside([ObjectSet(Objects(masks), {})], view, torch.Generator())
    crops = model.crops
    shown = crops.colour[0].permute(1, 2, 0)[crops.visible[0]]
    torch.testing.assert_close(shown, torch.tensor([1.0, 0.0, 0.4]).expand_as(shown))
    assert crops.others[1].sum() > 50  # the sheet behind the second box
    alone = replace(view, workspace=None)
    model.crops = None
    method.beside([ObjectSet(Objects(masks), {})], alone, torch.Generator())
    assert not model.crops.others[1].any()


def test_what_is_hardly_visible_has_no_shell():
    (hypothesis,), _, model = completed(explained=(1, 2, 3), min_pixels=10**5)
    assert not hypothesis.shells
    assert set(hypothesis.superquadrics) == {1, 2, 3}
    assert model.crops is None  # the network isn't asked


def test_of_several_views_and_of_no_object_nothing_is_said():
    view, labels = view_of()
    method = LearnedShapes(SimpleNamespace(model=TrueShells(BOXES), metadata=METADATA))
    for masks, shown in ((labels, Views((view,))), (0 * labels, view)):
        sets = [ObjectSet(Objects(masks), {})]
        assert method.beside(sets, shown, torch.Generator()) == sets


def test_weights_say_which_crops_they_learnt_from():
    wrong = {"resolution": 0, "margin": 0.5, "min_width": 0.0, "min_pixels": 0}
    for name, value in wrong.items():
        with pytest.raises(ConfigError, match=name):
            CropShape.of(metadata(**{name: value}))
    for nothing in ({}, {"crops": {"margin": 1.8}}, {"crops": None}):
        with pytest.raises(ConfigError, match="train them anew"):
            CropShape.of(nothing)
