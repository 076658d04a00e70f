"""From one real depth image to complete objects: checks, floor, workspace, network, objects."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import torch

from scenefw.core import rng
from scenefw.core.batches import Completion, PartialTSDF
from scenefw.core.errors import ConfigError
from scenefw.core.settings import COUNT
from scenefw.core.types import GridSpec, SceneEstimate
from scenefw.kernels.cameras import stack_cameras
from scenefw.matching.instances import renumbered_like
from scenefw.perception.carving import carve, whole_objects
from scenefw.perception.doctor import Doctor
from scenefw.perception.floor import Floor, FloorFinder
from scenefw.perception.objects import estimate_objects
from scenefw.perception.points import world_points
from scenefw.perception.seen_instances import seen_instances
from scenefw.perception.workspace import Workspace, WorkspaceFinder
from scenefw.postprocessing.confidence import Calibration, confidences
from scenefw.postprocessing.surfaces import instance_meshes

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray
    from torch import Tensor

    from scenefw.core.protocols import HypothesisRanking, MappingMethod
    from scenefw.core.types import Frame, Int32

    Mask = NDArray[np.bool_] | Int32

_FLOOR = 0.005  # m: what is lower shows no object
_SHAPE = ("tsdf", "votes")  # what objects are made of; other volumes are kept as they are


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
        floor: FloorFinder | None = None,
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
            raise ConfigError("the reconstructor has no grid; add 'reconstructor.grid=${grid}'")
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
        tsdf, instances = sample.tsdf[0], sample.instances[0]
        placed = sample.placed[0] if sample.placed else {}
        meshes = instance_meshes(tsdf, instances, self.grid)
        meshes |= {label: one.mesh() for label, one in placed.items() if label in meshes}
        floor = view.floor
        details = {
            "floor": {
                "normal": floor.normal,
                "height": floor.height,
                "share": floor.share,
                "deviation": floor.deviation,
            },
            "grid": asdict(self.grid),
            "samples": self.samples,
            "seed": self.seed,
            "checkpoint": self.reconstructor.metadata,
            "warnings": list(view.warnings),
        }
        return SceneEstimate(
            estimate_objects(meshes, sure, placed),
            self.grid,
            tsdf.cpu().numpy(),
            instances.cpu().numpy(),
            view.workspace.frame,
            details,
            {n: v[0].cpu().numpy() for n, v in sample.volumes.items() if n not in _SHAPE},
            self._masks(view, sample),
        )

    def _masks(self, view: View, sample: Completion) -> Int32:
        """Which object each pixel shows: as the method says, else by the volume at its point."""
        points = world_points(view.workspace.frame)
        instances = sample.instances[0].cpu().numpy()
        above = points[..., 2] > _FLOOR
        if sample.masks is None:
            return seen_instances(instances, points, self.grid, above)
        masks = sample.masks[0].cpu().numpy()
        shown = seen_instances(instances, points, self.grid, above & (masks == 0))
        return np.where(masks > 0, masks, shown)

    def _samples(self, partial: PartialTSDF) -> list[Completion]:
        """The scene of each code, without contradictions; an object has the same label in all."""
        generator = torch.Generator().manual_seed(rng.torch_seed(self.seed))
        samples = self.reconstructor.complete(partial, self.grid, self.samples, generator)
        cleaned = [self._cleaned(sample, partial) for sample in samples]
        first = cleaned[0].instances[0].cpu().numpy()
        return cleaned[:1] + [_renumbered(sample, first) for sample in cleaned[1:]]

    def _cleaned(self, sample: Completion, partial: PartialTSDF) -> Completion:
        shape = carve(sample.tsdf[0], partial, self.grid) if self.carve else sample.tsdf[0]
        tsdf, instances = whole_objects(shape, sample.instances[0], self.grid)
        return _followed(replace(sample, tsdf=tsdf[None]), instances)


def _renumbered(sample: Completion, like: Int32) -> Completion:
    labels = sample.instances[0]
    fitted = torch.from_numpy(renumbered_like(labels.cpu().numpy(), like)).to(labels.device)
    return _followed(sample, fitted)


def _followed(before: Completion, instances: Tensor) -> Completion:
    """With other instances; masks and shapes get the label that most voxels of theirs have now."""
    old, now = before.instances[0], {0: 0}
    for label in torch.unique(old[old > 0]).tolist():
        votes = torch.bincount(instances[(old == label) & (instances > 0)])
        now[label] = int(votes.argmax()) if len(votes) else 0
    masks = before.masks
    if masks is not None:
        table = torch.zeros(int(max(masks.max(), old.max())) + 1, dtype=torch.int32)
        table[list(now)] = torch.tensor(list(now.values()), dtype=torch.int32)
        masks = table.to(masks.device)[masks.long()]
    placed = tuple(
        {now[label]: one for label, one in view.items() if now.get(label)} for view in before.placed
    )
    return replace(before, instances=instances[None], masks=masks, placed=placed)
