"""What the steps of a reconstruction hand to each other, and what each step must do."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from scenefw.core.errors import InputError

if TYPE_CHECKING:
    import torch
    from numpy.random import Generator
    from torch import Tensor

    from scenefw.core.batches import Completion
    from scenefw.core.evidence import Evidence, FittedSuperquadric
    from scenefw.core.types import Float32, GridSpec, Int32, SceneEstimate, TriangleMesh
    from scenefw.fitting.vessels import FittedVessel
    from scenefw.perception.completion.extent_inputs import ExtentInputs
    from scenefw.perception.observation.observation import Observation, ViewGeometry
    from scenefw.perception.observation.views import View, Views
    from scenefw.postprocessing.confidence import ExpectedOverlap
    from scenefw.shapes.object_shell import ObjectShell


Observed = TypeVar("Observed", bound="Observation | Views", covariant=True)


@dataclass(frozen=True, eq=False)
class Objects:
    """Objects as far as a step knows them: which pixels show them, and roughly their room.

    Args:
        masks: (H, W) which object a pixel shows, 0 = none; None: nobody has said it.
        tsdf: (X, Y, Z) metres; None: no volume is known.
        instances: (X, Y, Z) labels; None likewise.
        volumes: further ones of a network, batches of one, by name of their representation.
        meshes: closed surfaces (m) of objects that volumes are too coarse for, by label.
    """

    masks: Int32 | None
    tsdf: Float32 | None = None
    instances: Int32 | None = None
    volumes: Mapping[str, Tensor] = field(default_factory=dict)
    meshes: Mapping[int, TriangleMesh] = field(default_factory=dict)

    @property
    def pixels(self) -> Int32:
        """The masks.

        Raises:
            InputError: nobody has said which pixels show the objects.
        """
        if self.masks is None:
            raise InputError("this method doesn't say which pixels show its objects")
        return self.masks


@dataclass(frozen=True, eq=False)
class Fits:
    """Superquadrics fitted to visible objects, each as if there were no others.

    Args:
        objects: all, those without a fit too.
        evidence: about objects of which enough is visible, by label.
        superquadrics: one for each of these, by label.
    """

    objects: Objects
    evidence: Mapping[int, Evidence] = field(default_factory=dict)
    superquadrics: Mapping[int, FittedSuperquadric] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class ObjectSet:
    """One hypothesis of a scene.

    Args:
        objects: masks, and volumes of those that no shape explains.
        superquadrics: by label; None: volumes stay as they are.
        vessels: by label.
        evidence: about objects of which enough is visible, by label.
        shells: other shapes of objects, by label, made when they're asked for; the assembly takes
            the more probable one.
    """

    objects: Objects
    superquadrics: Mapping[int, FittedSuperquadric] | None = None
    vessels: Mapping[int, FittedVessel] = field(default_factory=dict)
    evidence: Mapping[int, Evidence] = field(default_factory=dict)
    shells: Mapping[int, ObjectShell] = field(default_factory=dict)


class Observing(Protocol[Observed]):
    """Step 1: images in the frame of their floor (setting `observer`)."""

    def observe(self, frame: Any, grid: GridSpec, mask: Any = None) -> Observed:
        """The observation of a `Frame`, or of a sequence of them that show one scene.

        Raises:
            InputError: the image is unusable; the message says how to mend it.
        """


class Segmentation(Protocol):
    """Step 2: pixels that show the same object (group `segmentation`)."""

    def segment(self, view: View, /) -> Int32:
        """Segments (H, W), 0 = none, of a depth image above its floor z = 0.

        Args:
            view: its `depth`, `camera` and `colour` are those of a `Frame`.
        """


class EdgeRestoration(Protocol):
    """Step 3: edges as they were before the camera blurred them (setting `edges`)."""

    def restore(self, view: View, segments: Int32) -> tuple[View, Int32]:
        """The view and its segments with sharp edges."""


class Grouping(Protocol):
    """Step 4: which segments are one object (group `grouping`)."""

    @property
    def grid(self) -> GridSpec | None:
        """The grid that its volumes must have; None: any."""

    def group(self, segments: Int32 | None, view: View) -> Objects:
        """The objects, with rough volumes; without segments, those that volumes alone show."""


class ObjectFitting(Protocol):
    """Step 5: a superquadric for each visible object."""

    def fit(self, objects: Objects, view: View) -> Fits:
        """The best one for each of which enough is visible."""


class SetCompletion(Protocol):
    """Step 6: what is hidden, several times (group `completion`)."""

    @property
    def grid(self) -> GridSpec | None:
        """The grid that its volumes must have; None: any."""

    @property
    def metadata(self) -> Mapping[str, Any]:
        """Where its weights are from; empty without."""

    def complete(
        self, fits: Fits, view: View, samples: int, generator: torch.Generator
    ) -> Sequence[ObjectSet]:
        """`samples` hypotheses, the most typical one first, or one if all would be the same."""


class HiddenObjectSampling(Protocol):
    """Draws objects that a view hides wholly, for hypotheses of a set completion."""

    def beside(
        self,
        superquadrics: Sequence[FittedSuperquadric],
        seen_objects: ExtentInputs,
        view: ViewGeometry,
        random: Generator,
    ) -> list[FittedSuperquadric]:
        """Hidden objects of one scene, often none.

        Args:
            superquadrics: the visible objects, one for each of `seen_objects`.
            seen_objects: what the view shows of them.
            view: with its free space.
            random: for the draws.
        """


class ShellSampling(Protocol):
    """Draws shapes of single objects beside those of a set completion (group `shells`)."""

    @property
    def metadata(self) -> Mapping[str, Any]:
        """Where its weights are from."""

    def beside(
        self, sets: Sequence[ObjectSet], view: View, generator: torch.Generator
    ) -> list[ObjectSet]:
        """The hypotheses with shells of their objects, the best guess in the first one."""


class HollowReplacement(Protocol):
    """Step 7: bowls, cups and mugs (setting `hollow`)."""

    def replace(self, sets: Sequence[ObjectSet], view: View) -> Sequence[ObjectSet]:
        """The hypotheses, in which objects that the view looks into are hollow."""


class Assembly(Protocol):
    """Step 8: volumes, meshes, masks and confidences of hypotheses."""

    @property
    def calibration(self) -> ExpectedOverlap | None:
        """From cues about objects to their expected IoU; None: it was not fitted."""

    def volumes(self, sets: Sequence[ObjectSet], view: View) -> list[Completion]:
        """TSDF and instances of each hypothesis as it is."""

    def assemble(
        self, sets: Sequence[ObjectSet], view: View, origin: Mapping[str, Any]
    ) -> Iterator[SceneEstimate]:
        """The scenes; an object has the same id in all. `origin` goes into their details."""
