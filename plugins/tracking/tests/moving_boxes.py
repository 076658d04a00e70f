"""Noisy images of boxes that are added, moved and taken away, and a method that learns nothing."""

from dataclasses import replace

import numpy as np
from tests.unit.perception.obstacles import OBSTACLES
from tests.unit.perception.synthetic import Box, camera_at, frame_of
from tests.unit.perception.usual_fits import TOLERANCES, object_fit

from scenefw.core.types import GridSpec
from scenefw.fitting.joint import JointFit
from scenefw.fitting.superquadrics import SuperquadricFit
from scenefw.mapping.projective import Projective
from scenefw.perception.completion.superquadrics import FitSampling
from scenefw.perception.estimate.assembly import SceneAssembly
from scenefw.perception.grouping.hulls import HullFilling
from scenefw.perception.observation.doctor import Doctor
from scenefw.perception.observation.floor import FloorFinder
from scenefw.perception.observation.observer import Observer
from scenefw.perception.observation.workspace import WorkspaceFinder
from scenefw.perception.pipeline import ReconstructionPipeline
from scenefw.perception.segmentation.crease_segmentation import CreaseSegmentation

NOISE = 0.0015
"""m at 1 m, of a structured-light camera."""


def box(x, y, sides=(0.08, 0.06, 0.07), height=0.0):
    """A box that stands at a place of the table, or at a height above it."""
    half = np.array(sides[:2]) / 2
    low, high = np.array([x, y]) - half, np.array([x, y]) + half
    return Box((*low, height), (*high, height + sides[2]))


CROWD = (box(-0.2, 0.0), box(0.0, 0.02, (0.1, 0.1, 0.05)), box(0.18, 0.1, (0.04, 0.12, 0.12)))
"""Three boxes that are all different, apart from each other."""


def camera(width=320):
    """Looks down on the table; its images are 4 : 3."""
    return camera_at((0.1, -0.7, 0.75), (0.0, 0.1, 0.0), size=(width, width * 3 // 4))


def image(boxes, number, seen_by=None, noise=NOISE):
    """Image so many of a sequence, with noise of its own."""
    frame = frame_of(seen_by or camera(), boxes, name=f"image_{number}")
    random = np.random.default_rng(number)
    depth = frame.depth + random.normal(0, noise, frame.depth.shape) * frame.depth**2
    return replace(frame, depth=depth.astype(np.float32), labels=None)


def pipeline(samples=2):
    """Superquadrics fitted to segments between creases; its second hypothesis expects others."""
    observer = Observer(Projective(), FloorFinder(), WorkspaceFinder(OBSTACLES), Doctor())
    return ReconstructionPipeline(
        SceneAssembly(),
        observer,
        CreaseSegmentation(),
        grouping=HullFilling(),
        fit=object_fit(),
        completion=FitSampling(JointFit(SuperquadricFit()), TOLERANCES),
        grid=GridSpec(64),
        samples=samples,
    )
