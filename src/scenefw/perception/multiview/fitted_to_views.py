"""Superquadrics that explain several views at once (thesis eqs 5.8 to 5.12, 5.3)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from scenefw.fitting.placed import shape_of
from scenefw.mapping.several_views import fused, require_agreement
from scenefw.perception.completion.superquadrics import accepted
from scenefw.perception.completion.support import extend_to_support
from scenefw.perception.completion.vessels import with_vessels
from scenefw.perception.estimate.composition import composed
from scenefw.perception.observation.observation import JointGeometry, Observation
from scenefw.perception.steps import ObjectSet

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import torch

    from scenefw.core.batches import Completion, PartialTSDF
    from scenefw.core.evidence import FittedSuperquadric
    from scenefw.core.protocols import ShapeFit
    from scenefw.core.types import GridSpec
    from scenefw.fitting.vessels import FittedVessel
    from scenefw.perception.completion.vessels import Vessels
    from scenefw.perception.completion.volume_network import VolumeNetwork
    from scenefw.perception.evidence.object_fit import ObjectFit
    from scenefw.perception.evidence.tolerances import Tolerances
    from scenefw.perception.steps import Objects

_CORNERS = 6  # of meshes that say how high an object is
_MAX_DEPTH_BELOW = 0.01  # m below the floor


class ObjectsOfViews(Protocol):
    """Says which objects several views show together."""

    def group(
        self, views: Sequence[Observation], joint: JointGeometry, generator: torch.Generator
    ) -> Objects:
        """The objects, with rough volumes."""


class FusedVolumes:
    """The most typical scene of a network that sees the TSDF fused from all views.

    Args:
        network: completes a partial TSDF.
    """

    def __init__(self, network: VolumeNetwork) -> None:
        self.network = network

    def group(
        self, views: Sequence[Observation], joint: JointGeometry, generator: torch.Generator
    ) -> Objects:
        """The network's objects."""
        partial = fused([view.partial for view in views], joint.grid)
        return self.network.typical(Observation(None, partial, joint.grid))


class ViewsFit:
    """Superquadrics fitted to the visible points and free space of all views.

    An object that no superquadric explains in all views keeps its volume. What is mostly
    below the floor, or ends hardly above it, is noise of the floor and goes.

    Args:
        objects: says which objects there are.
        fit: of each object; all views are given to it as if they were one image.
        shapes: fits of all objects together.
        tolerances: say which superquadrics explain their objects.
        hollow: says which objects are hollow; None: none are.
        grid: of volumes; None: any.
    """

    def __init__(
        self,
        objects: ObjectsOfViews,
        fit: ObjectFit,
        shapes: ShapeFit,
        tolerances: Tolerances,
        hollow: Vessels | None = None,
        grid: GridSpec | None = None,
    ) -> None:
        self.objects, self.fit, self.shapes = objects, fit, shapes
        self.tolerances, self.hollow, self.grid = tolerances, hollow, grid

    def complete(
        self,
        views: Sequence[PartialTSDF],
        grid: GridSpec,
        samples: int,
        generator: torch.Generator,
    ) -> list[Completion]:
        """`samples` times the same complete scene of sharp objects.

        Raises:
            InputError: no view, views that contradict each other, or that came without images.
        """
        require_agreement(views, grid)
        observations = [Observation.of_partial(view, grid) for view in views]
        joint = JointGeometry(
            np.concatenate([view.points for view in observations]),
            grid,
            np.any([view.free for view in observations], axis=0),
        )
        objects = self.objects.group(observations, joint, generator)
        fits = self.fit.fit(objects, joint)
        evidence, superquadrics = list(fits.evidence.values()), list(fits.superquadrics.values())
        shapes = self.shapes.separate(evidence, superquadrics)
        hypothesis = accepted(fits, shapes, self.tolerances, joint)
        hypothesis = self._without_sunk(hypothesis, observations, joint)
        scene = composed(hypothesis, observations[0])
        return [replace(scene, masks=None)] * samples

    def _without_sunk(
        self, hypothesis: ObjectSet, views: Sequence[Observation], joint: JointGeometry
    ) -> ObjectSet:
        """The hypothesis with its vessels, and without objects that are noise of the floor."""
        accepted_shapes = dict(hypothesis.superquadrics or {})
        shape_of_label = {k: _out_of_floor(shape, joint) for k, shape in accepted_shapes.items()}
        sunk_labels = [
            k for k, shape in shape_of_label.items() if _is_sunk(shape, self.fit.min_height)
        ]
        objects = hypothesis.objects
        if objects.instances is not None:
            instances = np.where(np.isin(objects.instances, sunk_labels), 0, objects.instances)
            objects = replace(objects, instances=instances)
        vessels = self._vessels(objects, views, joint, accepted_shapes)
        superquadrics = {k: shape for k, shape in shape_of_label.items() if k not in sunk_labels}
        return with_vessels(
            replace(hypothesis, objects=objects, superquadrics=superquadrics), vessels
        )

    def _vessels(
        self,
        objects: Objects,
        views: Sequence[Observation],
        joint: JointGeometry,
        shapes: Mapping[int, FittedSuperquadric],
    ) -> dict[int, FittedVessel]:
        """Vessels, each as the view shows it into which it is seen first."""
        vessels: dict[int, FittedVessel] = {}
        if self.hollow is None:
            return vessels
        masks = np.split(objects.pixels, len(views))
        for view, mask in zip(views, masks, strict=True):
            geometry = replace(joint, points=view.points, eye=view.eye)
            labels = self.fit.visible(replace(objects, masks=mask), geometry)
            vessels = self.hollow.detect(mask, geometry, labels, shapes) | vessels
        return vessels


def _out_of_floor(superquadric: FittedSuperquadric, view: JointGeometry) -> FittedSuperquadric:
    """What reaches far below the floor, as a fit to a shape it isn't may, ends there instead."""
    return (
        extend_to_support([superquadric], view.free, view.grid)[0]
        if _heights(superquadric)[0] < -_MAX_DEPTH_BELOW
        else superquadric
    )


def _is_sunk(superquadric: FittedSuperquadric, min_height: float) -> bool:
    """Whether more of it is below the floor than above, or it ends lower than this (m)."""
    return bool(superquadric.pose.position[2] < 0 or _heights(superquadric)[1] < min_height)


def _heights(superquadric: FittedSuperquadric) -> tuple[float, float]:
    """Lowest and highest point over the floor (m)."""
    heights = (
        shape_of(superquadric).mesh(_CORNERS).vertices @ superquadric.pose.rotation[2]
        + superquadric.pose.position[2]
    )
    return float(heights.min()), float(heights.max())
