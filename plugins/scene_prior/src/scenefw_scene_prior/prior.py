"""Whole scenes drawn without a view, as estimates that can be looked at, edited and simulated."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from scenefw.core import geometry, rng
from scenefw.core.batches import SceneParameters
from scenefw.core.errors import ConfigError
from scenefw.core.set_flows import SetFlowBatch
from scenefw.core.types import Camera, Frame, GridSpec, PlacedShape, Pose, SceneEstimate
from scenefw.kernels.cameras import floor_depths, stack_cameras
from scenefw.kernels.superquadric_rays import first_hits
from scenefw.perception.estimate.objects import estimate_objects
from scenefw.representations.volumes import scene_volumes
from scenefw.shapes.superquadric import Superquadric
from scenefw_scene_prior.pushing_apart import pushed_apart

if TYPE_CHECKING:
    from collections.abc import Iterator

    from scenefw.core.protocols import Settling
    from scenefw.core.training_protocols import Trained
    from scenefw_scene_prior.protocols import WholeSetFlowModel

_HALF_AXIS_RANGE = (2e-3, 0.5)  # m
_EYE, _TARGET = (-0.9, 0.0, 0.6), (0.0, 0.0, 0.05)  # m


class ScenePrior:
    """Draws scenes of superquadrics from the prior of a flow of sets.

    A draw is pushed apart where objects run into each other, and then left to gravity. Piles that
    fall are drawn anew, with as many objects, so what comes out stands. Without `settling`, draws
    come as they are.

    Args:
        checkpoint: of a flow of whole sets (`model=set_flow`).
        grid: of the volumes of the scenes; draws with objects outside are drawn anew.
        settling: lets objects come to rest; None takes every draw as it is.
        steps: of each draw.
        attempts: draws for each scene at most.

    Raises:
        ConfigError: a number below one, or a network that draws nothing without a view.
    """

    def __init__(
        self,
        checkpoint: Trained[WholeSetFlowModel],
        grid: GridSpec,
        settling: Settling | None = None,
        steps: int = 20,
        attempts: int = 20,
    ) -> None:
        if min(steps, attempts) < 1:
            raise ConfigError(
                f"a prior of scenes has steps {steps} and attempts {attempts}; expected 1 or more"
            )
        if not checkpoint.model.draws_hidden:
            raise ConfigError(
                "this network draws nothing without a view; give checkpoints.set_flow=FILE of a "
                "training of model=set_flow"
            )
        self.model, self.grid, self.settling = checkpoint.model, grid, settling
        self.steps, self.attempts = steps, attempts

    def scenes(self, count: int, seed: int = 0) -> Iterator[SceneEstimate]:
        """Scenes one after the other; `details["drawn"]` says how many draws each one took.

        Args:
            count: of scenes.
            seed: scene i depends on it and on i alone.

        Raises:
            ConfigError: no scene stands after all attempts.
        """
        for number in range(count):
            yield self._scene(seed, number)

    def _scene(self, seed: int, number: int) -> SceneEstimate:
        generator = torch.Generator().manual_seed(rng.torch_seed(seed, number))
        count = int(self.model.scenes(1, generator, 1).present.sum())
        samples = self.model.scenes(self.attempts, generator, self.steps, count)
        for row in range(self.attempts):
            objects = _placed_shapes(samples, row)
            if not objects or not self._inside(objects):
                continue
            if self.settling is None:
                return self._estimate(objects, seed, number, row)
            scene = self._estimate(pushed_apart(objects), seed, number, row)
            scene = self.settling.settle([scene])[0]
            if scene.details["settled"]["stable"]:
                return _render(scene)
        raise ConfigError(
            f"scene {number + 1}: none of {self.attempts} draws stands; raise run.prior.attempts, "
            "or ~settling for draws as they are"
        )

    def _inside(self, objects: list[PlacedShape]) -> bool:
        """Whether all middles lie in the grid."""
        places = np.array([item.pose.position for item in objects])
        lower = np.array(self.grid.lower)
        return bool(((places > lower) & (places < lower + self.grid.extent)).all())

    def _estimate(
        self, objects: list[PlacedShape], seed: int, number: int, row: int
    ) -> SceneEstimate:
        camera = Camera(T_world_camera=geometry.look_at(_EYE, _TARGET))
        name = f"scene_{number + 1:03d}"
        frame = Frame(np.zeros((camera.height, camera.width), np.float32), camera, name=name)
        placed = dict(enumerate(objects, start=1))
        meshes = {label: item.mesh() for label, item in placed.items()}
        estimates = estimate_objects(meshes, dict.fromkeys(placed, 1.0), placed)
        empty = np.zeros(self.grid.shape)
        facts = {"drawn": {"seed": seed, "number": number + 1, "draws": row + 1}}
        return _render(
            SceneEstimate(
                estimates, self.grid, empty.astype(np.float32), empty.astype(np.int32), frame, facts
            )
        )


def _placed_shapes(samples: SetFlowBatch, row: int) -> list[PlacedShape]:
    """The objects of one draw; what is not finite is left out."""
    present = samples.present[row].cpu().numpy()
    axes, exponents, rotations, positions = (
        field[row].double().cpu().numpy()[present]
        for field in (samples.half_axes, samples.exponents, samples.rotations, samples.positions)
    )
    placed_shapes = []
    for parameters in zip(axes, exponents, rotations, positions, strict=True):
        if all(np.isfinite(values).all() for values in parameters):
            shape = Superquadric(np.clip(parameters[0], *_HALF_AXIS_RANGE), parameters[1])
            pose = Pose(parameters[3], geometry.quaternion_from_rotation(parameters[2]))
            placed_shapes.append(PlacedShape(shape, pose))
    return placed_shapes


def _render(scene: SceneEstimate) -> SceneEstimate:
    """The scene with volumes of its objects, and what its camera sees of them."""
    placed = [item.placed for item in scene.objects if item.placed is not None]
    parameters, camera = _parameters(placed), scene.frame.camera
    volumes = scene_volumes(parameters, scene.grid)
    cameras = stack_cameras([camera])
    depth, owners = first_hits(parameters, cameras)
    owner = owners[0].numpy()
    image = torch.where(owners > 0, depth, floor_depths(cameras))[0].numpy()
    ids = np.array([0, *(item.id for item in scene.objects)], dtype=np.int32)
    reach = scene.grid.truncation
    return replace(
        scene,
        tsdf=volumes.tsdf[0, 0].clamp(-reach, reach).numpy(),
        instances=ids[volumes.instances[0].numpy()],
        frame=replace(scene.frame, depth=image),
        masks=ids[owner],
    )


def _parameters(placed: list[PlacedShape]) -> SceneParameters:
    def of(values: list[Any]) -> torch.Tensor:
        return torch.from_numpy(np.array(values, dtype=np.float32))[None]

    shapes = [item.shape for item in placed if isinstance(item.shape, Superquadric)]
    return SceneParameters(
        of([shape.half_axes for shape in shapes]),
        of([shape.exponents for shape in shapes]),
        of([item.pose.rotation for item in placed]),
        of([item.pose.position for item in placed]),
        torch.ones(1, len(placed), dtype=torch.bool),
    )
