"""From one real depth image to complete objects: checks, floor, workspace, network, objects."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import torch

from scenefw.core import rng
from scenefw.core.errors import ConfigError
from scenefw.core.floors import Floor
from scenefw.core.settings import COUNT
from scenefw.kernels.cameras import stack_cameras
from scenefw.perception.estimate.assembly import cleaned, numbered_like, scene_estimate
from scenefw.perception.observation.doctor import Doctor
from scenefw.perception.observation.floor import FloorFinder
from scenefw.perception.observation.workspace import Workspace, WorkspaceFinder
from scenefw.postprocessing.confidence import Calibration, confidences

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from scenefw.core.batches import Completion, PartialTSDF
    from scenefw.core.protocols import FloorFinding, HypothesisRanking, MappingMethod
    from scenefw.core.types import Frame, GridSpec, Int32, SceneEstimate

    Mask = NDArray[np.bool_] | Int32


class GridReconstructor(Protocol):
    """A method that completes scenes on its own grid, and knows its origin."""

    grid: GridSpec
    metadata: dict[str, Any]
    calibration: Calibration | None
    """From how alike its samples are to how right objects are; None: it was not measured."""

    def complete(
        self, partial: PartialTSDF, grid: GridSpec, samples: int, generator: torch.Generator
    ) -> Sequence[Completion]:
        """Complete scenes of B partial views, once per code."""


@dataclass(frozen=True)
class View:
    """A depth image made ready for the network.

    Args:
        frame: as it was read.
        floor: what the objects stand on, in the frame's camera coordinates.
        workspace: the frame in the world frame, and which pixels show objects.
        partial: batch of one.
        warnings: what looks wrong, one line each.
    """

    frame: Frame
    floor: Floor
    workspace: Workspace
    partial: PartialTSDF
    warnings: tuple[str, ...]


class Pipeline:
    """Completes the objects of a real depth image (thesis 5.2.4, "Real data experiments").

    Args:
        reconstructor: from partial TSDF to complete TSDF and instances.
        mapping: from depth to partial TSDF.
        floor: finds the floor.
        workspace: finds the objects on it.
        doctor: checks the image before, and what was found.
        samples: latent codes tried; the first is the zero code and makes the result, the others
            its confidences.
        ranking: orders the others; None leaves them as they were drawn.
        carve: also takes away what the network puts into seen free space or below the floor.
        seed: of the codes.

    Raises:
        ConfigError: no sample, or the reconstructor has no grid.
    """

    def __init__(
        self,
        reconstructor: GridReconstructor,
        mapping: MappingMethod,
        floor: FloorFinding | None = None,
        workspace: WorkspaceFinder | None = None,
        doctor: Doctor | None = None,
        samples: int = 3,
        ranking: HypothesisRanking | None = None,
        *,
        carve: bool = True,
        seed: int = 0,
    ) -> None:
        COUNT.require(samples=samples)
        if reconstructor.grid is None:
            raise ConfigError(
                "the reconstructor has no grid; give grid=${grid} to what makes its volumes: "
                "'reconstructor.grid=${grid}', or 'reconstructor.inner.inner.grid=${grid}' of fits"
            )
        self.reconstructor = reconstructor
        self.mapping = mapping
        self.floor = floor or FloorFinder()
        self.workspace = workspace or WorkspaceFinder()
        self.doctor = doctor or Doctor()
        self.samples, self.ranking = samples, ranking
        self.carve = carve
        self.seed = seed

    @property
    def grid(self) -> GridSpec:
        """The voxel grid of partial views and results."""
        return self.reconstructor.grid

    def estimate(self, frame: Frame) -> SceneEstimate:
        """The complete scene of a frame, whose camera needs no pose.

        Raises:
            InputError: the image is unusable; the message says how to fix it.
        """
        return self.complete(self.prepare(frame))

    def prepare(self, frame: Frame, mask: Mask | None = None) -> View:
        """Checks, floor, workspace and partial TSDF of a frame.

        Args:
            frame: its camera needs no pose.
            mask: (H, W) of what is known to be objects: booleans say where some are, whole numbers
                which one a pixel shows (0 = none). Anything else above the floor is then ignored.

        Raises:
            InputError: as `estimate`.
        """
        warnings = self.doctor.examine_frame(frame)
        floor = self.floor.find(frame)
        region = None if mask is None else mask > 0
        workspace = self.workspace.find(frame, floor, self.grid, region)
        warnings += self.doctor.examine_workspace(floor, workspace)
        depth = torch.from_numpy(workspace.frame.depth)[None]
        cameras = stack_cameras([workspace.frame.camera])
        partial = self.mapping.fuse(depth, self.grid, cameras)
        colour = workspace.frame.colour
        if colour is not None:
            partial = replace(partial, colours=torch.from_numpy(np.array(colour, order="C"))[None])
        if mask is not None and mask.dtype != np.bool_:
            known = np.where(workspace.objects, mask, 0).astype(np.int32)
            partial = replace(partial, masks=torch.from_numpy(known)[None])
        return View(frame, floor, workspace, partial, tuple(warnings))

    def complete(self, view: View) -> SceneEstimate:
        """The complete scene of a view, the most typical one."""
        return next(self._drawn(view))

    def hypotheses(self, view: View) -> Iterator[SceneEstimate]:
        """A scene for each code: the most typical one, then drawn ones as they are ranked.

        An object has the same id in all of them. Its confidence says how much the others agree.
        """
        scenes = self._drawn(view)
        yield from scenes if self.ranking is None else self.ranking.rank(list(scenes))

    def _drawn(self, view: View) -> Iterator[SceneEstimate]:
        samples = self._samples(view.partial)
        for number, sample in enumerate(samples):
            others = [other.instances[0] for i, other in enumerate(samples) if i != number]
            sure = confidences(sample.instances[0], others, self.reconstructor.calibration)
            yield self._scene(view, sample, sure)

    def _scene(self, view: View, sample: Completion, sure: Mapping[int, float]) -> SceneEstimate:
        floor = view.floor
        details = {
            "floor": {
                "normal": floor.normal,
                "height": floor.height,
                "share": floor.share,
                "deviation": floor.deviation,
            },
            "samples": self.samples,
            "seed": self.seed,
            "checkpoint": self.reconstructor.metadata,
            "warnings": list(view.warnings),
        }
        return scene_estimate(sample, self.grid, view.workspace.frame, sure, details)

    def _samples(self, partial: PartialTSDF) -> list[Completion]:
        """The scene of each code, without contradictions; an object has the same label in all."""
        generator = torch.Generator().manual_seed(rng.torch_seed(self.seed))
        samples = self.reconstructor.complete(partial, self.grid, self.samples, generator)
        seen = partial if self.carve else None
        whole = [cleaned(sample, self.grid, seen) for sample in samples]
        first = whole[0].instances[0].cpu().numpy()
        return whole[:1] + [numbered_like(sample, first) for sample in whole[1:]]
