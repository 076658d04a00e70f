"""The data side of a training step of labelling networks, from numbers of samples to a batch.

    python -m benchmarks --only "labelling step"    # times, beside the network's part
    python -m benchmarks.label_data                 # what scenes weigh, and what the host does

On CUDA where there is a device, in batches of 32, else on the CPU in batches of 2. Views are
rendered from new cameras, with light and a depth camera's noise; crops are cut from maps that stay
on the device. The first peer is the step's other part, forward and backward of the network in
bfloat16: a ratio above 1 means that the network never waits.
"""

import statistics
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numba
import numpy as np
import torch

from benchmarks.harness import Job, Timed
from benchmarks.training_data import finished
from scenefw.core.batches import SegmentationBatch
from scenefw.core.rng import Streams
from scenefw.losses.cross_entropy import CrossEntropy
from scenefw.models.fusenet import FuseNet
from scenefw.noise.kinect import Kinect
from scenefw.renderers.mesh_raycaster import MeshRaycaster
from scenefw.renderers.tables import PreparedTable, Tables, camera_lenses, prepared
from scenefw_tabletops.data.label_views import RenderedViews, ViewSamples
from scenefw_tabletops.data.light import ColourJitter
from scenefw_tabletops.data.map_crops import MapCrops, RenderedMaps
from scenefw_tabletops.data.segmentation import Samples
from scenefw_tabletops.data.table_scenes import TabletopScenes
from scenefw_tabletops.scenes.tabletop import TabletopGenerator
from scenefw_tabletops.shapes.tabletop.library import ProceduralModels

DEVICE = torch.device("cuda" if torch.cuda.is_available() else "cpu")
WIDE = (64, 96, 160, 256)
BATCH, SCENES, WIDTHS = (32, 40, WIDE) if DEVICE.type == "cuda" else (2, 4, (16, 24, 48, 80))
VERTICES = 1025 if DEVICE.type == "cuda" else 513


def source(contrast: float = 0.1) -> TabletopScenes:
    """Scenes of the training split."""
    scenes = TabletopGenerator(ProceduralModels())
    return TabletopScenes(scenes, MeshRaycaster(contrast), limit=SCENES, vertices=VERTICES)


def views(*, contrast: float = 0.1, noise: bool = True, renew: int = 1) -> ViewSamples:
    """As `experiment=label_views scale=thesis` draws them, with noise."""
    noises = {"kinect": Kinect(0.05, lateral=0.35, axial=0.5, nearest=0.1)} if noise else {}
    images = RenderedViews(source(contrast), 100, renew)
    return ViewSamples(images, noises, ColourJitter(), 0, "height")


def drawn(samples: Samples) -> Callable[[], SegmentationBatch]:
    """The next batch at every call."""
    order = np.random.default_rng(0).permutation(len(samples))
    place = 0

    @torch.no_grad()
    def draw() -> SegmentationBatch:
        nonlocal place
        place += BATCH
        return samples.batch(order[np.arange(place, place + BATCH) % len(order)], 0, DEVICE)

    draw()  # compiled, scenes on the device
    if DEVICE.type == "cuda":
        torch.cuda.set_sync_debug_mode("error")
        draw()
        torch.cuda.set_sync_debug_mode("default")
    return draw


def rendered() -> Timed:
    """With noise and light."""
    return finished(drawn(views()))


def plain() -> Timed:
    """One ray per pixel, without noise."""
    return finished(drawn(views(contrast=1.0, noise=False)))


def cropped() -> Timed:
    """Of true maps, with noise on heights."""
    maps = RenderedMaps(source())
    return finished(drawn(MapCrops(maps, 40, jitter=ColourJitter(), height_noise=5e-4, unseen=0.3)))


def network() -> Timed:
    """Forward and backward on such a batch."""
    batch, loss = drawn(views(noise=False))(), CrossEntropy()
    model = FuseNet(4, WIDTHS, (1, 2, 2, 3), scale=0.02).to(
        DEVICE, memory_format=torch.channels_last
    )

    def step() -> None:
        with torch.autocast(DEVICE.type, torch.bfloat16):
            scores = model(batch.colour, batch.distance)
        loss(scores.float(), batch).backward()
        model.zero_grad()

    return finished(step)


_STEP = f"forward and backward of the network, widths {WIDTHS}"
_WHAT = f"{BATCH} 320 x 240, {DEVICE.type}"
JOBS = [
    Job(
        f"views of a labelling step, {_WHAT}",
        rendered,
        {_STEP: network, "one ray per pixel, no noise": plain},
    ),
    Job(f"crops of a labelling step, {_WHAT}", cropped, {_STEP: network}),
]


def facts(scenes: int = 12) -> str:
    """Triangles and bytes of scenes, time to make them, and the host's work for a batch of 32."""
    known = TabletopScenes(TabletopGenerator(ProceduralModels()), MeshRaycaster())
    for scene in range(scenes):  # the first use of a model makes it
        known.scene(scene)
    times: dict[str, list[float]] = {"parameters": [], "triangles": [], "tree": []}
    tables = []
    for scene in range(scenes):
        clock = [time.process_time()]
        made = known.scene(scene)
        clock.append(time.process_time())
        geometry = known.scenes.geometry(made)
        clock.append(time.process_time())
        tables.append(prepared(geometry))
        clock.append(time.process_time())
        for name, seconds in zip(times, np.diff(clock), strict=True):
            times[name].append(seconds)
    size = statistics.mean(sum(a.nbytes for a in t.arrays.values()) for t in tables)
    faces = statistics.mean(len(t.order) for t in tables)
    each = ", ".join(f"{n} {1e3 * statistics.median(t):.0f} ms" for n, t in times.items())
    return (
        f"{faces:.0f} triangles and {size / 1e6:.2f} MB per scene, 500 scenes {size / 2e3:.0f} MB\n"
        f"made in (CPU time of one core): {each}\n"
        f"the host draws a batch of 32 in {1e3 * _host():.2f} ms\n"
        f"a view of 320 x 240 (CPU time of one core): {_split(tables)}"
    )


def _split(tables: list[PreparedTable]) -> str:
    """What depth and labels, colour, and further rays at edges take of a view."""
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    images = RenderedViews(source(), 100)
    numbers, lens = np.arange(0, SCENES * 100, 100), images.source.lens
    _, poses = images.poses(numbers, 0)
    intrinsics = np.array([[lens.fx, lens.fy, lens.cx, lens.cy]] * SCENES)
    lenses = torch.from_numpy(camera_lenses(intrinsics, poses))
    where = (torch.arange(SCENES, dtype=torch.int32), lenses, (lens.width, lens.height))
    times = {}
    for name, contrast in (("one ray per pixel", 1.0), ("four more at edges", 0.1)):
        shown = Tables(tables[:SCENES], "cpu", contrast)
        times[name] = _cpu_time(partial(shown.render, *where)) / SCENES
    dark = [replace(t, arrays={**t.arrays, "scenes": _without_lamps(t)}) for t in tables[:SCENES]]
    shown = Tables(dark, "cpu", 1.0)
    times["without lamps, so without shadows"] = _cpu_time(lambda: shown.render(*where)) / SCENES
    numba.set_num_threads(threads)
    return ", ".join(f"{name} {1e3 * seconds:.0f} ms" for name, seconds in times.items())


def _without_lamps(table: PreparedTable) -> np.ndarray:
    scenes = table.arrays["scenes"].copy()
    scenes[:, 4] = scenes[:, 3]
    return scenes


def _cpu_time(work: Callable[[], object], repeats: int = 5) -> float:
    work()  # compiled
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return statistics.median(times)


def _host() -> float:
    images, indices, times = RenderedViews(source(), 100), np.arange(32), []
    for epoch in range(30):
        start = time.process_time()
        _, poses = images.poses(indices, epoch)
        camera_lenses(np.ones((32, 4)), poses)
        noise, light = Streams.of(0, 5, epoch, indices=indices).split(2)
        ColourJitter().draw(light)
        noise.seeds(1)
        times.append(time.process_time() - start)
    return statistics.median(times)


if __name__ == "__main__":
    print(facts())
