"""From depth images to complete objects, in nine steps."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np
import torch

from scenefw.core import rng
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.settings import COUNT
from scenefw.perception.observation.observation import Observation
from scenefw.perception.observation.views import Views
from scenefw.perception.segmentation.marked import MarkedObjects
from scenefw.perception.steps import Fits, Objects, ObjectSet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from scenefw.core.batches import Completion, PartialTSDF
    from scenefw.core.protocols import HypothesisRanking
    from scenefw.core.types import Frame, GridSpec, Int32, SceneEstimate
    from scenefw.perception.observation.views import View
    from scenefw.perception.steps import (
        Assembly,
        EdgeRestoration,
        Grouping,
        HollowReplacement,
        ObjectFitting,
        Observing,
        Segmentation,
        SetCompletion,
    )
    from scenefw.postprocessing.confidence import ExpectedOverlap


Observed = TypeVar("Observed", bound=Observation | Views)


class ReconstructionPipeline(Generic[Observed]):
    """Completes the objects of a depth image; each step can be replaced, and None leaves it out.

    Methods that learn nothing, networks of volumes, and methods for several views of a scene are
    this class with other steps.

    Args:
        observer: 1, brings an image into the frame of its floor; None: only views whose floor is
            known can be completed (`complete`, `complete_views`).
        segmentation: 2, finds pixels that show the same object.
        edges: 3, restores what a stereo camera has blurred.
        grouping: 4, says which segments are one object, and makes rough volumes.
        fit: 5, fits a superquadric to each object.
        completion: 6, says what is hidden, several times.
        hollow: 7, makes objects hollow that the view looks into.
        assembly: 8, makes volumes, meshes, masks and confidences.
        ranking: 9, orders the hypotheses after the first.
        grid: of volumes, where no step has one; None: any.
        samples: hypotheses; the first is the most typical one.
        seed: of the random numbers.

    Raises:
        ConfigError: no sample.
    """

    def __init__(
        self,
        assembly: Assembly,
        observer: Observing[Observed] | None = None,
        segmentation: Segmentation | None = None,
        edges: EdgeRestoration | None = None,
        grouping: Grouping | None = None,
        fit: ObjectFitting | None = None,
        completion: SetCompletion | None = None,
        hollow: HollowReplacement | None = None,
        ranking: HypothesisRanking | None = None,
        grid: GridSpec | None = None,
        samples: int = 3,
        seed: int = 0,
    ) -> None:
        COUNT.require(samples=samples)
        self.observer, self.segmentation, self.edges = observer, segmentation, edges
        self.grouping, self.fit, self.completion = grouping, fit, completion
        self.hollow, self.assembly, self.ranking = hollow, assembly, ranking
        networks = [step.grid for step in (completion, grouping) if step is not None]
        self.grid: GridSpec | None = next(filter(None, networks), grid)
        self.metadata: dict[str, Any] = {} if completion is None else dict(completion.metadata)
        self.samples, self.seed = samples, seed

    @property
    def calibration(self) -> ExpectedOverlap | None:
        """From cues about objects to their expected IoU; None: it was not fitted."""
        return self.assembly.calibration

    def __call__(
        self, frame: Frame | Sequence[Frame], mask: NDArray[np.bool_] | Int32 | None = None
    ) -> list[SceneEstimate]:
        """The hypotheses of a scene, the most typical one first.

        Args:
            frame: one whose camera needs no pose; or, as the observer says, several with poses.
            mask: (H, W) of what is known to be objects (`observation.observer`).

        Raises:
            InputError: the image is unusable; the message says how to mend it.
        """
        return self.reconstruct(self.observe(frame, mask))

    def estimate(self, frame: Frame | Sequence[Frame]) -> SceneEstimate:
        """The most typical scene.

        Raises:
            InputError: as `__call__`.
        """
        return self.reconstruct(self.observe(frame), first_only=True)[0]

    def observe(
        self, frame: Frame | Sequence[Frame], mask: NDArray[np.bool_] | Int32 | None = None
    ) -> Observed:
        """Step 1, which finds out what is wrong with an image before anything takes long."""
        if self.observer is None or self.grid is None:
            setting = "observer" if self.observer is None else "grid"
            raise ConfigError(
                f"the pipeline has no {setting}; give 'reconstructor.{setting}=${{{setting}}}'"
            )
        view = self.observer.observe(frame, self.grid, mask)
        if view.masks is not None and self.grouping is None:
            note = "masks say where objects are; which is which, this reconstructor finds by itself"
            return replace(view, warnings=(*view.warnings, note))
        return view

    def reconstruct(
        self, view: View, *, first_only: bool = False, regions: Int32 | None = None
    ) -> list[SceneEstimate]:
        """Steps 2 to 9: the scenes of an observation, the most typical one first.

        Args:
            view: the observation.
            first_only: only the most typical one, whose confidences come from all.
            regions: (H, W) parts of the image, across whose borders no object goes; what is in 0
                is left out. None: all of it is one.
        """
        generator = torch.Generator().manual_seed(rng.torch_seed(self.seed))
        sets = self.hypotheses(view, self.samples, generator, regions)
        origin = {"samples": self.samples, "seed": self.seed, "checkpoint": self.metadata}
        scenes = self.assembly.assemble(sets, view, origin)  # 8
        if first_only:
            return [next(scenes)]
        return list(scenes) if self.ranking is None else self.ranking.rank(list(scenes))  # 9

    def hypotheses(
        self,
        view: View,
        samples: int,
        generator: torch.Generator,
        regions: Int32 | None = None,
    ) -> Sequence[ObjectSet]:
        """Steps 2 to 7: sets of objects that there may be, the most typical one first.

        Args:
            view: the observation.
            samples: how many sets.
            generator: of the random numbers, on the CPU.
            regions: (H, W) parts of the image, across whose borders no object goes; what is in 0
                is left out. None: all of it is one.
        """
        segments = None
        segmentation = self.segmentation if view.masks is None else MarkedObjects()
        if segmentation is not None:
            segments = segmentation.segment(view)  # 2
            if self.edges is not None:
                view, segments = self.edges.restore(view, segments)  # 3
            if regions is not None:
                segments = _within(segments, regions)
        objects = Objects(segments)
        if self.grouping is not None:
            objects = self.grouping.group(segments, view)  # 4
        fits = Fits(objects) if self.fit is None else self.fit.fit(objects, view)  # 5
        sets: Sequence[ObjectSet] = [ObjectSet(objects)] * samples
        if self.completion is not None:
            sets = self.completion.complete(fits, view, samples, generator)  # 6
        return sets if self.hollow is None else self.hollow.replace(sets, view)  # 7

    def complete(
        self, partial: PartialTSDF, grid: GridSpec, samples: int, generator: torch.Generator
    ) -> list[Completion]:
        """Volumes of the hypotheses of a view whose floor is known to be z = 0, as they are.

        Args:
            partial: of one view.
            grid: its grid.
            samples: hypotheses.
            generator: of the random numbers, on the CPU.

        Raises:
            InputError: there are several views, or the steps need its image and it has none.
        """
        if len(partial.distance) != 1:
            raise InputError(f"there are {len(partial.distance)} views; complete one after another")
        view = Observation.of_partial(partial, grid)
        return self.assembly.volumes(self.hypotheses(view, samples, generator), view)

    def complete_views(
        self,
        views: Sequence[PartialTSDF],
        grid: GridSpec,
        samples: int,
        generator: torch.Generator,
    ) -> list[Completion]:
        """Volumes of the hypotheses of several views whose floor is known to be z = 0.

        Args:
            views: of one scene, batches of one.
            grid: of all.
            samples: hypotheses.
            generator: of the random numbers, on the CPU.

        Raises:
            InputError: no view, or views that contradict each other; or the steps need their
                images and they have none.
        """
        view = Views.of_partials(views, grid)
        return self.assembly.volumes(self.hypotheses(view, samples, generator), view)


def _within(segments: Int32, regions: Int32) -> Int32:
    """Segments (H, W) cut along the borders of regions, without those of region 0."""
    pairs = np.where(regions > 0, segments * (int(regions.max()) + 1) + regions, 0)
    labels = np.unique(np.where(segments > 0, pairs, 0), return_inverse=True)[1]
    return labels.reshape(segments.shape).astype(np.int32)
