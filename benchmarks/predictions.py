"""A prediction with all its files, and one picture of it.

The image is of a ball and two boxes, with disparities rounded to an eighth of a pixel. The peers of
the whole prediction are scenefw without pictures, and what it computes alone.
"""

import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import torch

import scenefw
from benchmarks.harness import Job, Timed
from benchmarks.rays import VIEW, stack_depth
from scenefw.core.types import SceneEstimate
from scenefw.perception.pipeline import ReconstructionPipeline
from scenefw.report.shading import draw
from scenefw.report.solids import solids_of
from scenefw.report.window import SIZE, cropped, window
from scenefw.tasks.predict import Predict

_BASELINE = 0.075  # m, of a Kinect
_STEPS = 8  # of disparity in a pixel
THREADS = torch.get_num_threads()


def image() -> np.ndarray:
    """Depth (480, 640) in metres."""
    exact = stack_depth()[0].numpy()
    scale = VIEW.fx * _BASELINE * _STEPS
    seen = np.rint(scale / np.maximum(exact, 0.1))
    return np.where(exact > 0, scale / seen, 0).astype(np.float32)


@cache
def pipeline() -> ReconstructionPipeline:
    """That of `run=predict`."""
    return scenefw.load("reconstruction", device="cpu").pipeline


@cache
def scene() -> SceneEstimate:
    """What is predicted."""
    return scenefw.load("reconstruction", device="cpu").predict(image(), VIEW).samples[0]


def predicted(**settings: Any) -> Timed:
    """Three hypotheses, written into a folder."""
    kept = tempfile.TemporaryDirectory()
    folder = Path(kept.name)
    np.savez(folder / "image.npz", depth=image(), K=VIEW.matrix)
    task = Predict(folder / "image.npz", pipeline(), folder / "out", **settings)

    def predict(_: object = kept) -> object:
        return task.predict(folder / "image.npz", folder / "out" / "image")

    return predict


def computed() -> Timed:
    """Three hypotheses, nothing written."""
    predictor, depth = scenefw.load("reconstruction", device="cpu"), image()
    return lambda: predictor.predict(depth, VIEW)


def pictured() -> Timed:
    """The objects from the camera, made ready for drawing before."""
    (solid,) = solids_of([scene()])
    camera = cropped(scene().frame.camera, *window(scene()))
    return lambda: draw(solid, camera)


def cast() -> Timed:
    """Depth of the same triangles in open3d: geometry alone, a ray per pixel."""
    import open3d as o3d

    triangles = o3d.t.geometry.RaycastingScene()
    for item in scene().objects:
        faces = item.mesh.faces.astype(np.uint32)
        triangles.add_triangles(item.mesh.vertices.astype(np.float32), faces)
    camera = cropped(scene().frame.camera, *window(scene()))
    v, u = np.mgrid[: camera.height, : camera.width]
    local = [(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)]
    ahead = np.stack(local, axis=-1) @ camera.T_world_camera[:3, :3].T
    origin = np.broadcast_to(camera.T_world_camera[:3, 3], ahead.shape)
    rays = o3d.core.Tensor(np.concatenate([origin, ahead], -1).astype(np.float32))
    return lambda: triangles.cast_rays(rays)["t_hit"].numpy()


def drawn_by_matplotlib() -> Timed:
    """The same triangles, flat and without shadows."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(SIZE[0] / 100, SIZE[1] / 100), dpi=100)
    canvas = FigureCanvasAgg(figure)

    def render() -> object:
        figure.clear()
        axes = figure.add_subplot(projection="3d")
        for item in scene().objects:
            x, y, z = item.mesh.vertices.T
            axes.plot_trisurf(x, y, z, triangles=item.mesh.faces)
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())

    return render


def without(**settings: bool) -> Callable[[], Timed]:
    """A prediction that leaves something out."""
    return lambda: predicted(**settings)


JOBS = [
    Job(
        f"prediction of 640 x 480, three hypotheses, all files and pictures, {THREADS} threads",
        predicted,
        {
            "without pictures": without(overview=False),
            "without pictures and page": without(overview=False, page=False),
            "nothing written": computed,
        },
        seconds=20.0,
    ),
    Job(
        f"picture {SIZE[0]} x {SIZE[1]} of a predicted scene with light and shadows",
        pictured,
        {"open3d ray casting, depth alone": cast, "matplotlib, flat": drawn_by_matplotlib},
    ),
]
