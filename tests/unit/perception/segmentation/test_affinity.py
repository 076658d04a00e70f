"""Parts by a network of affinities: one that knows the truth, and one that is trained."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
import torch
from hydra.utils import instantiate
from scipy.ndimage import binary_erosion, gaussian_filter
from tests.composed import option
from tests.unit.perception.synthetic import Box, camera_at, frame_of

from scenefw.core.errors import ConfigError
from scenefw.data.files.readers import read_frames
from scenefw.learning.checkpoint import load_checkpoint
from scenefw.losses.part_affinity import true_affinities
from scenefw.perception.observation.floor import FloorFinder
from scenefw.perception.observation.observation import Observation
from scenefw.perception.segmentation import affinity as affinity_parts
from scenefw.perception.segmentation.affinity import AffinitySegmentation
from scenefw.perception.segmentation.crease_segmentation import CreaseSegmentation
from scenefw.perception.segmentation.region_merging import RegionMerging
from scenefw_single_view_benchmarks.mask_scores import mask_scores


class Knowing(torch.nn.Module):
    """Says of pixels whether their owners, an image (H, W), are the same."""

    shown = obstacles = None

    def __init__(self, owners, focal):
        super().__init__()
        self.owners, self.focal = torch.from_numpy(owners.astype(np.int32)), focal
        self.any = torch.nn.Parameter(torch.zeros(1))

    def forward(self, depth, cameras, colour=None):
        step = round(self.owners.shape[1] / depth.shape[2])
        same, _ = true_affinities(self.owners[None, ::step, ::step])
        return torch.where(same, 4.0, -4.0)


@dataclass
class Loaded:
    model: torch.nn.Module
    metadata: dict = field(default_factory=dict)


@pytest.fixture(scope="module")
def seen():
    camera = camera_at(eye=(0.0, -0.85, 0.6))
    frame = frame_of(camera)
    return replace(frame, camera=camera), frame.labels


@pytest.mark.parametrize("thinned", [1, 2, 3])
def test_true_affinities_give_true_parts(seen, thinned):
    frame, owners = seen
    focal = frame.camera.fx / thinned
    parts = AffinitySegmentation(Loaded(Knowing(owners, focal)), min_pixels=20).segment(
        Observation(frame)
    )
    above = (parts > 0) & (owners > 0)
    assert above.sum() > 0.97 * (owners > 0).sum()
    for label in np.unique(owners[owners > 0]):
        most = np.bincount(parts[above & (owners == label)])
        assert most.max() > 0.95 * most.sum()
    assert parts.max() == len(np.unique(owners[owners > 0]))


def test_pixels_beside_a_jump_go_to_what_they_show(monkeypatch):
    """A sliver behind a box: a few pixels of the box, taken for it, would stretch it there."""
    front, back = (
        Box((-0.1, -0.2, 0.0), (0.1, -0.1, 0.15)),
        Box((0.083, 0.2, 0.0), (0.13, 0.3, 0.1)),
    )
    camera = camera_at(eye=(0.0, -0.85, 0.35))
    frame = replace(frame_of(camera, (front, back)), camera=camera)
    owners = frame.labels
    finder = AffinitySegmentation(Loaded(Knowing(owners, camera.fx / 3)), min_pixels=10)

    def astray():
        parts = finder.segment(Observation(frame))
        assert parts.max() == 2
        names = np.array([0, *(np.bincount(owners[parts == part]).argmax() for part in (1, 2))])
        assert sorted(names) == [0, 1, 2]
        return ((parts > 0) & (owners > 0) & (names[parts] != owners)).sum()

    assert astray() == 0
    monkeypatch.setattr(affinity_parts, "TOUCH", np.inf)
    assert astray() > 0  # the image has such pixels


@pytest.mark.parametrize("thinned", [1, 2])
def test_a_sliver_behind_an_object_is_no_part_of_it(monkeypatch, thinned):
    """Of what shows a few pixels behind a box, no neighbours surely are the same object."""
    front, back = (
        Box((-0.1, -0.2, 0.0), (0.1, -0.1, 0.15)),
        Box((0.083, 0.2, 0.0), (0.13, 0.3, 0.1)),
    )
    camera = camera_at(eye=(0.0, -0.85, 0.35))
    frame = replace(frame_of(camera, (front, back)), camera=camera)
    owners = frame.labels
    network = Knowing(owners, camera.fx / thinned)

    def forward(depth, cameras, colour=None):
        logits = Knowing.forward(network, depth, cameras)
        behind = torch.from_numpy(owners[::thinned, ::thinned] == 2)
        return torch.where(behind & (logits > 0), 2.0, logits)  # likely, not surely

    network.forward = forward
    few = (owners == 2).sum() // thinned**2
    for smallest, parts in ((1, 2), (4 * few, 1)):
        finder = AffinitySegmentation(Loaded(network), min_pixels=4 * smallest * thinned**2)
        found = finder.segment(Observation(frame))
        assert found.max() == parts
        assert len(np.unique(found[(owners == 1) & (found > 0)])) == 1
        shared = np.unique(found[owners == 1]).tolist()
        assert not np.isin(found[owners == 2], [one for one in shared if one > 0]).any()


def test_images_without_objects_have_no_parts(seen):
    frame, owners = seen
    finder = AffinitySegmentation(Loaded(Knowing(0 * owners, frame.camera.fx)))
    assert finder.segment(Observation(replace(frame, depth=np.zeros_like(frame.depth)))).max() == 0


@pytest.mark.parametrize(("inside", "gap"), [(4.0, 0.9), (4.0, 2.0), (6.5, 3.3)])
def test_a_few_likely_pixels_do_not_join_two_objects(seen, inside, gap):
    """A gap of three pixels in the border: with a threshold alone, even of 0.95, they would."""
    frame, owners = seen
    network = Knowing(owners, frame.camera.fx)
    true = network.forward(torch.from_numpy(frame.depth)[None], None) * inside / 4
    rows, columns = np.nonzero((owners[:-1] == 2) & (owners[1:] == 1))
    true[0, 1, rows[10:13], columns[10:13]] = gap
    network.forward = lambda *_: true
    assert (
        AffinitySegmentation(Loaded(network), min_pixels=20).segment(Observation(frame)).max() == 2
    )
    joined = (
        AffinitySegmentation(Loaded(network), min_pixels=20, merging=RegionMerging(intercept=99.0))
        .segment(Observation(frame))
        .max()
    )
    assert joined == 1


@pytest.mark.parametrize(
    "wrong",
    [
        {"min_basin_depth": 0.0},
        {"min_pixel_probability": 1.0},
        {"floor_margin": -0.1},
        {"min_pixels": 0},
    ],
)
def test_bad_settings(seen, wrong):
    with pytest.raises(ConfigError, match=f"^{next(iter(wrong))} = "):
        AffinitySegmentation(Loaded(Knowing(seen[1], 100.0)), **wrong)


class Showing(Knowing):
    """The same, and it knows which pixels show the objects of these labels."""

    shown = True

    def __init__(self, owners, focal, *shown):
        super().__init__(owners, focal)
        self.which = torch.from_numpy(np.isin(owners, shown))

    def forward(self, depth, cameras, colour=None):
        step = round(self.owners.shape[1] / depth.shape[2])
        third = torch.where(self.which[None, None, ::step, ::step], 3.0, -3.0)
        return torch.cat([super().forward(depth, cameras), third], dim=1)


@pytest.mark.parametrize("thinned", [1, 2])
def test_what_shows_no_object_is_in_no_part(seen, thinned):
    frame, owners = seen
    focal = frame.camera.fx / thinned
    every, first = (
        AffinitySegmentation(Loaded(Showing(owners, focal, *shown)), min_pixels=20).segment(
            Observation(frame)
        )
        for shown in ((1, 2), (1,))
    )
    plain = AffinitySegmentation(Loaded(Knowing(owners, focal)), min_pixels=20).segment(
        Observation(frame)
    )
    near = 1.0 if thinned == 1 else 0.97  # the border of thinned pixels
    assert (every == plain)[plain > 0].mean() >= near
    assert not every[plain == 0].any()
    assert first.max() == 1
    other = (owners == 2) & (first > 0)
    assert other.sum() < 0.03 * (owners == 2).sum()  # pixels of thinned images on its border
    anything = AffinitySegmentation(
        Loaded(Showing(owners, focal)),
        min_pixels=20,
        min_pixel_probability=0.0,
    )
    assert np.array_equal(anything.segment(Observation(frame)), plain)


@pytest.mark.parametrize("waving", [False, True])
def test_pixels_that_show_no_object_leave_their_part(seen, waving):
    """As those of a ramp beside an object: the part as a whole shows one.

    Where neighbours err independently, what is many deviations above the floor isn't the floor.
    """
    frame, owners = seen
    model = Showing(owners, frame.camera.fx, 1, 2)
    rim = (owners == 1) & ~binary_erosion(owners == 1, iterations=2)
    model.which[torch.from_numpy(rim)] = False

    def parts(image, **settings):
        finder = AffinitySegmentation(Loaded(model), min_pixels=20, **settings)
        return finder.segment(Observation(image))

    noise = np.random.default_rng(0).normal(size=owners.shape)
    noise = gaussian_filter(noise, 4) if waving else noise
    noise = (0.0005 * noise / noise.std()).astype(np.float32)
    noisy = replace(frame, depth=np.where(owners > 0, frame.depth, frame.depth + noise))
    strict, lenient = parts(noisy), parts(noisy, min_pixel_probability=0.0)
    assert (lenient[rim] > 0).mean() > 0.7  # the rest stands on the floor
    assert (strict > 0)[(lenient > 0) & ~rim].all()
    assert (strict > 0)[(owners > 0) & ~rim].mean() > 0.99  # pixels near the floor, too
    if waving:
        assert not strict[rim].any()
    else:
        assert (strict[rim] > 0).mean() > 0.7
    # the floor of an image without noise is where heights end
    assert np.array_equal(parts(frame), parts(frame, min_pixel_probability=0.0))


def test_parts_as_low_as_the_floor_waves_are_its_noise():
    flat, box = Box((-0.2, -0.1, 0.0), (-0.05, 0.0, 0.015)), Box((0.05, -0.1, 0.0), (0.2, 0.0, 0.1))
    camera = camera_at(eye=(0.0, -0.9, 0.5))
    frame = replace(frame_of(camera, (flat, box)), camera=camera)
    finder = AffinitySegmentation(Loaded(Knowing(frame.labels, camera.fx)))
    assert finder.segment(Observation(frame)).max() == 2
    rng = np.random.default_rng(0)
    normal = gaussian_filter(rng.normal(size=frame.depth.shape).astype(np.float32), 4)
    waves = frame.depth + 0.007 * frame.depth**2 * normal / normal.std()
    noisy = replace(frame, depth=np.where(frame.labels > 0, frame.depth, waves))
    found = finder.segment(Observation(noisy))
    assert found.max() >= 1
    assert not (found[frame.labels == 1] > 0).any()
    assert (found[frame.labels == 2] > 0).mean() > 0.9


def half_sure(thinned, logit=0.0):
    """A box that a network cuts in two, as sure as `logit` says: image, halves, network."""
    camera = camera_at(eye=(0.0, -0.85, 0.6))
    frame = replace(frame_of(camera, (Box((-0.15, -0.1, 0.0), (0.15, 0.1, 0.1)),)), camera=camera)
    middle = frame.labels.shape[1] // 2
    halves = np.where(frame.labels > 0, 1 + (np.arange(frame.labels.shape[1]) >= middle), 0)
    network = Knowing(halves, camera.fx / thinned)

    def forward(depth, cameras, colour=None):
        logits = Knowing.forward(network, depth, cameras)
        box = torch.from_numpy(frame.labels[::thinned, ::thinned] > 0)
        beside = box & torch.roll(box, -1, 1)
        logits[:, 0] = torch.where(beside & (logits[:, 0] < 0), logit, logits[:, 0])
        return logits

    network.forward = forward
    return frame, halves, network


@pytest.mark.parametrize("thinned", [1, 2])
def test_what_no_jump_and_no_crease_cuts_counts_as_evidence(thinned):
    frame, halves, network = half_sure(thinned, logit=-2.0)

    def number(image=frame, **weights):
        merging = RegionMerging(
            CreaseSegmentation(min_pixels=20), affinity=0.8, log_pixels=0.0, **weights
        )
        finder = AffinitySegmentation(Loaded(network), min_pixels=20, merging=merging)
        return finder.segment(Observation(image)).max()

    unmerged = AffinitySegmentation(Loaded(network), min_pixels=20, merging=None)
    assert unmerged.segment(Observation(frame)).max() == 2
    assert number(intercept=1.0, same_part=0.0) == 2
    assert number(intercept=1.0, same_part=1.5) == 1
    lifted = np.where(halves == 2, frame.depth - 0.05, frame.depth)  # a jump
    assert number(replace(frame, depth=lifted), intercept=1.0, same_part=1.5) == 2


@pytest.mark.exhaustive
def test_shipped_weights_cut_real_images_better_than_creases_do(real_data):
    """Parts alone, before fits join them: labelled images, and ten things on a wavy floor."""
    folder = real_data / "real"
    loaded = load_checkpoint(None, task="part_affinity", shipped="part_affinity")
    methods = {
        "network": AffinitySegmentation(loaded),
        "creases": instantiate(option("segmentation", "creases")),
    }
    floor = FloorFinder()

    def cut(method, frame):
        pose = floor.find(frame).T_world_camera
        return method.segment(Observation(replace(frame, camera=frame.camera.moved(pose))))

    frames = read_frames(folder / "mosd_learn")
    scores = {
        name: [mask_scores(cut(method, frame), frame.labels) for frame in frames]
        for name, method in methods.items()
    }
    for measure in ("overlap_f", "boundary_f"):
        network, creases = (
            np.mean([getattr(one, measure) for one in scores[name]]) for name in methods
        )
        assert network > creases
    first = next(iter(read_frames(folder / "realsense_table")))
    assert 10 <= cut(methods["network"], first).max() <= 20


@pytest.mark.parametrize("thinned", [1, 2])
def test_what_is_as_low_as_waves_is_an_objects_if_the_network_says_so(thinned):
    """As the bottom of a bowl: heights alone would cut it out."""
    plate = Box((-0.15, -0.1, 0.0), (0.0, 0.1, 0.003))
    wall = Box((0.0, -0.1, 0.0), (0.15, 0.1, 0.06))
    camera = camera_at(eye=(0.0, -0.85, 0.6))
    frame = replace(frame_of(camera, (plate, wall)), camera=camera)
    owners = (frame.labels > 0).astype(np.int32)
    noise = gaussian_filter(np.random.default_rng(0).normal(size=owners.shape), 4)
    depth = frame.depth + (0.003 * noise / noise.std()).astype(np.float32)
    noisy = Observation(replace(frame, depth=np.where(frame.depth > 0, depth, 0)))
    finder = AffinitySegmentation(Loaded(Showing(owners, camera.fx / thinned, 1)))
    parts = finder.segment(noisy)
    assert parts.max() == 1
    assert (parts[frame.labels == 1] > 0).mean() > 0.95
    heights_alone = replace(finder, min_pixel_probability=0.0).segment(noisy)
    assert (heights_alone[frame.labels == 1] > 0).mean() < 0.5
    assert (parts[owners == 0] > 0).mean() < 0.01
