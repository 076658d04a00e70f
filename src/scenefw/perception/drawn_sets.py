"""Superquadrics of a view whose hidden parts, and hidden objects, a trained flow of sets draws."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import torch
from scipy.spatial import cKDTree

from scenefw.core import geometry
from scenefw.core.batches import SceneParameters
from scenefw.core.errors import ConfigError
from scenefw.core.evidence import FittedSuperquadric
from scenefw.core.types import Pose
from scenefw.data.seen_sets import in_frame, view_frame
from scenefw.fitting.placed import in_frame_of, shape_of, signed_distance
from scenefw.models.superquadric_tokens import equal_descriptions
from scenefw.perception.fitted import Fitted

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.random import Generator
    from torch import Tensor

    from scenefw.core.batches import SeenSetBatch
    from scenefw.core.evidence import Evidence
    from scenefw.core.training_protocols import SetFlowModel
    from scenefw.core.types import Float64
    from scenefw.perception.evidence import EvidenceOfView, View
    from scenefw.perception.part_guided import Completing

_POINTS = 192  # as in training: fewer end before the object does
_NEAR = 0.006  # m: points further from the fit belong to something else
_LEAST = 0.004  # m, of half-axes
_CORNERS = 6  # of meshes that say where a drawn object is
_SEEN_THROUGH = 0.05  # share of a hidden object that may lie where the view shows free space
_INSIDE = 0.2  # share of a hidden object that may lie in others


class SizedFit(Protocol):
    """A fit of objects, alone and then with expected sizes."""

    def fit(self, evidence: Sequence[Evidence]) -> list[FittedSuperquadric]:
        """The best superquadric for each."""

    def draws(
        self, evidence: Sequence[Evidence], count: int, generator: Generator
    ) -> list[list[FittedSuperquadric]]:
        """The best superquadrics, and then draws of what they may be as well."""

    def alone(self, evidence: Sequence[Evidence]) -> list[FittedSuperquadric]:
        """The best superquadric for each, as if there were no others."""

    def together(
        self, evidence: Sequence[Evidence], start: Sequence[FittedSuperquadric]
    ) -> list[FittedSuperquadric]:
        """Superquadrics near those, fitted again such that none penetrates another."""


class TrainedFlow(Protocol):
    """What a loaded checkpoint provides (`learning.checkpoint.load_checkpoint`)."""

    model: SetFlowModel
    metadata: Mapping[str, Any]


class DrawnSets(Fitted):
    """Superquadrics fitted to the view, and to draws of a network where nothing is seen.

    Objects that the image shows are fitted (`Fitted`). The network sees their points and draws
    sets: how far each object goes on, and objects of which nothing is seen. Points of a drawn
    surface that lie away from all that is seen of its object are evidence about it as well. All are
    fitted again, from what was drawn, so that what is seen decides where it speaks. For the first
    sample the faces of objects are in the middle of several draws.

    Args:
        inner: makes the scenes.
        fit: of superquadrics to evidence.
        evidence: what a view says about an object.
        checkpoint: of a flow of sets.
        near: seen points up to this far from the surface are explained (m).
        explained: share of seen points that a superquadric must explain to be taken.
        least: seen points that an object must have to be fitted.
        lowest: how high above the floor what was not predicted must reach to be an object (m).
        steps: of each draw.
        votes: draws whose middle the first sample takes; 0: it is the fit without a network.
        drawn_sigma: standard deviation of points of drawn surfaces (m).
        beyond: points of drawn surfaces count that are further than this from all seen ones (m).
        drawn: the first sample is the best, further ones are drawn; without it, all are the best.
        hidden: draws have objects of which nothing is seen.

    Raises:
        ConfigError: a number that isn't positive.
    """

    def __init__(
        self,
        inner: Completing,
        fit: SizedFit,
        evidence: EvidenceOfView,
        checkpoint: TrainedFlow,
        near: float = 0.006,
        explained: float = 0.75,
        least: int = 60,
        lowest: float = 0.015,
        steps: int = 20,
        votes: int = 32,
        drawn_sigma: float = 0.008,
        beyond: float = 0.01,
        *,
        drawn: bool = True,
        hidden: bool = True,
    ) -> None:
        super().__init__(inner, fit, evidence, near, explained, least, lowest, drawn=drawn)
        if steps < 1 or votes < 0 or not drawn_sigma > evidence.seen_sigma or beyond < 0:
            raise ConfigError(
                f"drawn sets have steps {steps}, votes {votes}, drawn_sigma {drawn_sigma} and "
                f"beyond {beyond}; expected positive numbers, and what is drawn less certain than "
                f"what is seen ({evidence.seen_sigma} m)"
            )
        self.sized, self.model, self.hidden = fit, checkpoint.model, hidden
        self.steps, self.votes = steps, votes
        self.drawn_sigma, self.beyond = drawn_sigma, beyond
        self.metadata = dict(checkpoint.metadata)

    def superquadrics(
        self, view: View, count: int = 1, random: Generator | None = None
    ) -> list[dict[int, FittedSuperquadric]]:
        """Objects that a superquadric explains, by label; in draws also those that nobody sees.

        Args:
            view: with the predicted volumes.
            count: of results: the best one, then draws.
            random: for the draws.
        """
        random = np.random.default_rng(0) if random is None else random
        enough = self._enough(view)
        given = list(enough.values())
        alone = self.sized.alone(given)
        draws = Draws(
            self.model, view, list(enough), alone, self.votes + count - 1, self.steps, random
        )
        results = []
        for number in range(count):
            row = self.votes + number - 1
            if number > 0:
                found = self._near(draws.middle(slice(row, row + 1), alone), given)
            elif self.votes:
                found = self._near(draws.middle(slice(self.votes), alone), given)
            else:
                found = self.sized.together(given, alone)
            kept = self._kept(found, alone, enough)
            if self.hidden and number > 0:
                first = int(max(view.instances.max(initial=0), view.masks.max(initial=0))) + 1
                kept |= dict(enumerate(_possible(draws.hidden(row), view, kept), first))
            results.append(kept)
        return results

    def _near(
        self, drawn: Sequence[FittedSuperquadric], evidence: Sequence[Evidence]
    ) -> list[FittedSuperquadric]:
        """Superquadrics that explain what is seen, and are as drawn where nothing is."""
        expected = [self._expected(*both) for both in zip(evidence, drawn, strict=True)]
        found = self.sized.together(expected, drawn)
        return [
            replace(one, distances=signed_distance(one, given.points))
            for one, given in zip(found, evidence, strict=True)
        ]

    def _expected(self, evidence: Evidence, drawn: FittedSuperquadric) -> Evidence:
        """What is seen, with the drawn surface where nothing is."""
        seen = self._seen(evidence)
        surface = shape_of(drawn).mesh(_CORNERS).vertices
        surface = surface @ drawn.pose.rotation.T + drawn.pose.position
        away = surface[cKDTree(evidence.points[seen]).query(surface)[0] > self.beyond]
        return replace(
            evidence,
            points=np.concatenate([evidence.points[seen], away]),
            sigmas=np.concatenate([evidence.sigmas[seen], np.full(len(away), self.drawn_sigma)]),
        )

    def _kept(
        self,
        found: Sequence[FittedSuperquadric],
        alone: Sequence[FittedSuperquadric],
        enough: Mapping[int, Evidence],
    ) -> dict[int, FittedSuperquadric]:
        """Each object as it was drawn, else as fitted alone, if that explains what is seen."""
        kept = {}
        for label, one, plain in zip(enough, found, alone, strict=True):
            if self._explains(one, enough[label]):
                kept[label] = one
            elif self._explains(plain, enough[label]):
                kept[label] = plain
        return kept


class Draws:
    """Sets that a network draws for a view, in world coordinates.

    Args:
        model: the network.
        view: with masks.
        labels: of the objects in its masks, one slot each.
        fitted: superquadrics that explain them.
        count: of draws.
        steps: of each.
        random: where their seed is from.
    """

    def __init__(
        self,
        model: SetFlowModel,
        view: View,
        labels: Sequence[int],
        fitted: Sequence[FittedSuperquadric],
        count: int,
        steps: int,
        random: Generator,
    ) -> None:
        self.parts = len(labels)
        device = next(model.parameters()).device  # type: ignore[attr-defined]
        points = torch.zeros(1, len(labels), _POINTS, 3)
        sizes = torch.zeros(1, len(labels))
        for slot, label in enumerate(labels):
            own = view.points[view.masks == label]
            explained = own[np.abs(signed_distance(fitted[slot], own)) < _NEAR]
            own = explained if len(explained) else own
            points[0, slot] = torch.from_numpy(own[random.integers(len(own), size=_POINTS)])
            sizes[0, slot] = (view.masks == label).mean()
        eye = torch.from_numpy(np.asarray(view.eye, dtype=np.float32))[None]
        seen = torch.ones(1, len(labels), dtype=torch.bool)
        batch = in_frame(points, seen, sizes, eye, _scene_of(fitted))
        turn, origin = view_frame(points, seen, eye)
        generator = torch.Generator().manual_seed(int(random.integers(2**62)))
        moved = _on(batch, device)
        with torch.no_grad():
            drawn = _on(model.sample(moved, count, generator, steps), torch.device("cpu"))
        back = turn[0].T.double()
        self.rotations = (back @ drawn.rotations.double()).numpy()
        self.positions = (drawn.positions.double() @ back.T + origin[0].double()).numpy()
        self.half_axes = drawn.half_axes.double().numpy()
        self.exponents = drawn.exponents.double().numpy()
        self.present = drawn.present.numpy()

    def middle(self, rows: slice, fitted: Sequence[FittedSuperquadric]) -> list[FittedSuperquadric]:
        """Seen objects with faces in the middle of those of some draws.

        Args:
            rows: the draws.
            fitted: superquadrics whose axes and exponents they have.
        """
        return [self._middle_of(k, rows, one) for k, one in enumerate(fitted)]

    def _middle_of(self, k: int, rows: slice, fitted: FittedSuperquadric) -> FittedSuperquadric:
        axes = fitted.pose.rotation
        middles = self.positions[rows, k] @ axes
        pairs = zip(self.rotations[rows, k], self.half_axes[rows, k], strict=True)
        halves = np.array([along(axes, *pair) for pair in pairs])
        low, high = np.median(middles - halves, axis=0), np.median(middles + halves, axis=0)
        pose = Pose(axes @ (low + high) / 2, fitted.pose.quaternion)
        half_axes = np.maximum((high - low) / 2, _LEAST)
        return FittedSuperquadric(half_axes, fitted.exponents, pose, 0.0, np.empty(0))

    def hidden(self, row: int) -> list[FittedSuperquadric]:
        """Objects of one draw of which nothing is seen."""
        return [
            FittedSuperquadric(
                self.half_axes[row, k],
                self.exponents[row, k],
                Pose(
                    self.positions[row, k],
                    geometry.quaternion_from_rotation(self.rotations[row, k]),
                ),
                0.0,
                np.empty(0),
            )
            for k in range(self.parts, self.present.shape[1])
            if self.present[row, k]
        ]


_WAYS = equal_descriptions().numpy().astype(np.float64)


def along(axes: Float64, rotation: Float64, half_axes: Float64) -> Float64:
    """Half-axes (3,) of an object, in the order of other axes that are nearly its own.

    Args:
        axes: (3, 3), columns are the axes.
        rotation: (3, 3) of the object.
        half_axes: (3,) of the object.
    """
    agreement = np.einsum("ij,ik,wkj->w", axes, rotation, _WAYS)
    return np.asarray(np.abs(_WAYS[agreement.argmax()]).T @ half_axes)


def _possible(
    hidden: Sequence[FittedSuperquadric], view: View, others: Mapping[int, FittedSuperquadric]
) -> list[FittedSuperquadric]:
    """Hidden objects that lie neither where the view shows free space nor in other objects."""
    kept: list[FittedSuperquadric] = []
    for one in hidden:
        corners = shape_of(one).mesh(_CORNERS).vertices
        inner = np.concatenate([corners, 0.6 * corners, 0.2 * corners])
        places = inner @ one.pose.rotation.T + one.pose.position
        voxels = np.rint(view.grid.to_voxels(places)).astype(int)
        inside = ((voxels >= 0) & (voxels < view.grid.resolution)).all(axis=1)
        if not inside.all():
            continue
        x, y, z = voxels.T
        if view.free[x, y, z].mean() > _SEEN_THROUGH:
            continue
        solid = [
            (shape_of(other).value(in_frame_of(other, places)) < 1)
            for other in (*others.values(), *kept)
        ]
        if solid and np.any(solid, axis=0).mean() > _INSIDE:
            continue
        kept.append(one)
    return kept


def _scene_of(fitted: Sequence[FittedSuperquadric]) -> SceneParameters:
    """One scene (1, N) of fitted superquadrics."""

    def stacked(values: Sequence[Any], *shape: int) -> Tensor:
        return torch.from_numpy(np.array(values, dtype=np.float32).reshape(1, len(fitted), *shape))

    return SceneParameters(
        stacked([one.half_axes for one in fitted], 3),
        stacked([one.exponents for one in fitted], 3),
        stacked([one.pose.rotation for one in fitted], 3, 3),
        stacked([one.pose.position for one in fitted], 3),
        torch.ones(1, len(fitted), dtype=torch.bool),
    )


def _on(batch: SeenSetBatch, device: torch.device) -> SeenSetBatch:
    fields: dict[str, Tensor] = vars(batch)
    return type(batch)(**{name: value.to(device) for name, value in fields.items()})
