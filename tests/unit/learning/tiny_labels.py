"""A training of a tiny labelling network; run as a script, it may kill itself on the way."""

import sys
from pathlib import Path

import torch
from tests.unit.data.rectangles import Rectangles
from tests.unit.learning.tiny import Killer

from scenefw.learning.runtime.trainer import TrainerSettings
from scenefw.learning.schedules import CosineDecay
from scenefw.learning.segmentation import SegmentationLearning
from scenefw.losses.cross_entropy import CrossEntropy
from scenefw.models.fusenet import FuseNet
from scenefw.noise.gaussian import Gaussian
from scenefw.renderers.mesh_raycaster import MeshRaycaster
from scenefw.tasks.train import Train
from scenefw_tabletops.data.label_views import RenderedViews, StoredViews, ViewSamples
from scenefw_tabletops.data.light import ColourJitter
from scenefw_tabletops.data.segmentation import SegmentationData
from scenefw_tabletops.data.table_scenes import TabletopScenes
from scenefw_tabletops.scenes.tabletop import TabletopGenerator
from scenefw_tabletops.shapes.tabletop.library import ProceduralModels


def learning(classes=3, widths=(6, 8), **options):
    torch.manual_seed(0)
    network = FuseNet(classes, widths, (1,) * len(widths), offset=0.3, scale=0.02)
    options = {"learning_rate": 1e-2, "schedule": CosineDecay(steps=80, warmup=3), **options}
    return SegmentationLearning(network, {"cross_entropy": CrossEntropy()}, **options)


def data(views=4, **options):
    noise = {"gaussian": Gaussian(0.001)}
    train = ViewSamples(StoredViews(Rectangles(), views), noise, ColourJitter(), **options)
    validation = ViewSamples(StoredViews(Rectangles(1, seed=1), 2))
    return SegmentationData(train, validation, batch_size=2)


def rendered():
    """Four views of each of two table-tops, rendered anew in each epoch."""
    scenes = TabletopGenerator(ProceduralModels(), minimum=2, maximum=3)
    source = TabletopScenes(scenes, MeshRaycaster(), limit=2, size=(48, 40))
    train = ViewSamples(RenderedViews(source, 4), {"gaussian": Gaussian(0.001)}, ColourJitter())
    return SegmentationData(train, ViewSamples(RenderedViews(source, 1)), batch_size=2)


def task(folder, steps, source=data, doomed=False, **options):
    """Four batches of two views per epoch."""
    trainer = TrainerSettings("cpu", max_steps=steps, max_epochs=-1, validate_every=3)
    folder = Path(folder)
    return Train(
        learning(**options),
        source(),
        trainer,
        folder / "out",
        folder / "state",
        snapshot_steps=2,
        log_every=1,
        name="labels",
        callbacks={"killer": Killer(5)} if doomed else None,
    )


if __name__ == "__main__":
    folder, steps, what = sys.argv[1], int(sys.argv[2]), sys.argv[3:]
    if "rendered" in what:
        training = task(folder, steps, rendered, classes=4, widths=(4, 6))
    else:
        training = task(folder, steps, doomed="kill" in what)
    training.run()
