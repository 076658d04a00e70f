"""Whether drawn scenes are like true ones: what they are made of, and whether they stand."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import torch

from scenefw.core import rng
from scenefw.core.batches import SceneParameters
from scenefw.core.errors import ConfigError
from scenefw.core.set_flows import SetFlowBatch
from scenefw.core.settings import COUNT, NOT_NEGATIVE
from scenefw_scene_prior import references
from scenefw_scene_prior.left_to_gravity import (
    Gravity,
    concatenate_scenes,
    objects_of,
    select_scenes,
    separate_objects,
)
from scenefw_scene_prior.results import (
    APART,
    AT_REST,
    DRAWN,
    GIVEN,
    JITTERED,
    SHUFFLED,
    SHUFFLED_APART,
    SHUFFLED_AT_REST,
    TRAINING,
    TRUTH,
    PriorResult,
    Sample,
    ViewDraws,
)
from scenefw_scene_prior.scene_numbers import (
    descriptor,
    nearest_scene,
    object_numbers,
    quantities,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.protocols import Engine, Track
    from scenefw.core.training_protocols import Trained
    from scenefw.core.types import SceneObject
    from scenefw.data.batches.stacks import StackScenes
    from scenefw_scene_prior.protocols import WholeSetFlowModel

_REFERENCES, _DRAWS, _GIVEN, _CHOICE, _AT_REST = 1, 2, 3, 4, 5  # random streams
_SIZES = (1e-3, 1.0)  # m: half-axes that a simulator can take
_ROWS = (
    DRAWN, APART, AT_REST, GIVEN, TRUTH, TRAINING,
    SHUFFLED, SHUFFLED_APART, SHUFFLED_AT_REST, JITTERED,
)  # fmt: skip
_LOST = 10.0  # m: displacement that counts at most


class ViewedScenes(Protocol):
    """Training scenes, and views of any scenes (`data.batches.set_flow.SetFlowViews`)."""

    scenes: StackScenes

    def views_of(self, scenes: StackScenes, rows: Sequence[int]) -> SetFlowBatch:
        """A view of each scene, always the same."""


class SetPriorEvaluation:
    """Draws scenes without a view, and given views, and compares them with true ones.

    The references learn nothing: `shuffled` scenes are put together from shapes and positions of
    different training scenes, and `jittered` ones are true scenes whose objects are moved a little.
    Drawn and shuffled scenes count as they are, pushed apart (`physics.pushing_apart`), and left
    to gravity, where those that fall are drawn anew with as many objects, as `ScenePrior` does.
    `training` scenes show what a perfect sampler of the training distribution would reach. All
    samples are of equal size. A pile is stable if no centre moves by `furthest` and no object
    turns by `steepest` until everything rests.

    Args:
        checkpoint: of a flow of sets.
        data: training scenes, and views.
        scenes: true ones, of the split that is looked at.
        engine: simulates.
        steps: of each draw.
        physics_steps: of each simulation at most.
        furthest: of stable piles (m).
        steepest: of stable piles (degrees).
        shift: standard deviation of jitter (m).
        turn: standard deviation of jitter (degrees).
        examples: views shown with several draws; of each kind twice as many scenes are shown.
        draws: scenes of each kind; as many true ones are chosen; None: all.
        seed: of draws and references.

    Raises:
        ConfigError: a number below its range, or the network doesn't draw whole scenes.
    """

    def __init__(
        self,
        checkpoint: Trained[WholeSetFlowModel],
        data: ViewedScenes,
        scenes: StackScenes,
        engine: Engine,
        steps: int = 20,
        physics_steps: int = 10000,
        furthest: float = 0.2,
        steepest: float = 30.0,
        shift: float = 0.01,
        turn: float = 5.0,
        examples: int = 2,
        draws: int | None = None,
        seed: int = 0,
    ) -> None:
        COUNT.require(steps=steps, physics_steps=physics_steps)
        NOT_NEGATIVE.require(
            furthest=furthest, steepest=steepest, shift=shift, turn=turn, examples=examples
        )
        if not checkpoint.model.draws_hidden:
            raise ConfigError(
                "this network draws nothing without a view; give checkpoints.set_flow=FILE of a "
                "training of model=set_flow"
            )
        self.model, self.data, self.scenes = checkpoint.model, data, scenes
        self.steps, self.gravity = steps, Gravity(engine, physics_steps, furthest, steepest)
        self.shift, self.turn, self.examples, self.seed = shift, turn, examples, seed
        self.draws = len(scenes) if draws is None else min(draws, len(scenes))

    @torch.no_grad()
    def run(self, track: Track = lambda items, _: items) -> PriorResult:
        """Draws, simulates and compares; `track(items, what)` shows a bar of each loop."""
        true = rng.generator(self.seed, _CHOICE).permutation(len(self.scenes))[: self.draws]
        views = [self.data.views_of(self.scenes, [row]) for row in track(true.tolist(), "views")]
        rows = list(range(self.draws))
        kinds = self._references(true.tolist())
        kinds |= self._draw_scenes(len(rows))
        singles = [
            self._draw_from_view(view, row, 1) for row, view in track([*enumerate(views)], "draws")
        ]
        kinds[GIVEN] = concatenate_scenes(singles)
        training_numbers = object_numbers(_all_scenes(self.data.scenes))
        samples = {}
        for kind in _ROWS:
            scenes = [objects_of(kinds[kind], row) for row in rows]
            new = nearest_scene(object_numbers(kinds[kind]), training_numbers)
            samples[kind] = self._build_sample(scenes, new, track, kind)
        example_sets = {kind: [kinds[kind]] for kind in (DRAWN, TRUTH, SHUFFLED)}
        first = {
            kind: select_scenes(scene_sets[0], range(2 * self.examples))
            for kind, scene_sets in example_sets.items()
        }
        several = [
            ViewDraws(
                _seen_first(view),
                self._draw_from_view(view, row, 3),
                tuple(view.camera[0].tolist()),
            )
            for row, view in enumerate(views[: self.examples])
        ]
        return PriorResult(samples, first, tuple(several), self.scenes.split)

    def _references(self, true_rows: list[int]) -> dict[str, SceneParameters]:
        random, count = rng.generator(self.seed, _REFERENCES), len(true_rows)
        training, true = _all_scenes(self.data.scenes), self.scenes.parameters(true_rows)
        order = random.permutation(len(self.data.scenes))
        order = np.resize(order, count)  # fewer training scenes than drawn ones come again
        shuffled = references.shuffled(training, count, random)
        jittered = references.jittered(true, self.shift, self.turn, random)
        gravity_random = rng.generator(self.seed, _REFERENCES, _AT_REST)

        def draw(scenes: int, objects: int) -> SceneParameters:
            return references.shuffled(training, scenes, gravity_random, objects)

        return {
            TRUTH: true,
            TRAINING: select_scenes(training, order.tolist()),
            SHUFFLED: shuffled,
            SHUFFLED_APART: separate_objects(shuffled),
            SHUFFLED_AT_REST: self.gravity.at_rest(draw, _counts(shuffled)),
            JITTERED: jittered,
        }

    def _draw_scenes(self, count: int) -> dict[str, SceneParameters]:
        generator = torch.Generator().manual_seed(rng.torch_seed(self.seed, _DRAWS))
        samples = _usable(self.model.scenes(count, generator, self.steps))
        gravity_generator = torch.Generator().manual_seed(
            rng.torch_seed(self.seed, _DRAWS, _AT_REST)
        )

        def draw(scenes: int, objects: int) -> SceneParameters:
            return _usable(self.model.scenes(scenes, gravity_generator, self.steps, objects))

        at_rest = self.gravity.at_rest(draw, _counts(samples))
        return {DRAWN: samples, APART: separate_objects(samples), AT_REST: at_rest}

    def _draw_from_view(self, view: SetFlowBatch, row: int, count: int) -> SceneParameters:
        generator = torch.Generator().manual_seed(rng.torch_seed(self.seed, _GIVEN, row))
        return _usable(self.model.sample(self._on_device(view), count, generator, self.steps))

    def _on_device(self, view: SetFlowBatch) -> SetFlowBatch:
        device = next(self.model.parameters()).device  # type: ignore[attr-defined]
        return SetFlowBatch(**{name: value.to(device) for name, value in vars(view).items()})

    def _build_sample(
        self,
        scenes: Sequence[Sequence[SceneObject]],
        new: Any,
        track: Track,
        kind: str,
    ) -> Sample:
        values = [quantities(scene) for scene in scenes]
        stable, shifts = [], []
        for scene in track(scenes, f"piles, {kind}"):
            object_motions = self.gravity.motions(scene)
            stable.append(self.gravity.stands(object_motions))
            moves = [min(m.shift, _LOST) for m in object_motions]
            shifts.append(float(np.mean(moves)) if moves else float("nan"))
        rows = [
            descriptor(scene, scene_values)
            for scene, scene_values in zip(scenes, values, strict=True)
        ]
        return Sample(tuple(values), np.array(rows), np.array(stable), np.array(shifts), new)


def _usable(batch: SetFlowBatch) -> SceneParameters:
    """Drawn scenes; objects that are not finite are left out, sizes kept within bounds."""
    scene = _scene(batch)
    finite = torch.stack(
        [field.isfinite().flatten(2).all(dim=2) for name, field in vars(scene).items()
         if name != "present"]
    ).all(dim=0)  # fmt: skip
    still = finite[..., None]
    zeros = torch.zeros_like(scene.positions)
    eye = torch.eye(3).expand_as(scene.rotations)
    return SceneParameters(
        torch.where(still, scene.half_axes, zeros + 0.01).clamp(*_SIZES),
        torch.where(still, scene.exponents, zeros + 2.0),
        torch.where(still[..., None], scene.rotations, eye),
        torch.where(still, scene.positions, zeros),
        scene.present & finite,
    )


def _scene(batch: SetFlowBatch) -> SceneParameters:
    fields = (batch.half_axes, batch.exponents, batch.rotations, batch.positions, batch.present)
    return SceneParameters(*(field.cpu() for field in fields))


def _seen_first(view: SetFlowBatch) -> SceneParameters:
    """The true scene of a view with its objects in the order of drawn ones: seen, then hidden."""
    order = view.seen[0].int().argsort(descending=True, stable=True).cpu()
    return SceneParameters(*(field[:, order] for field in vars(_scene(view)).values()))


def _counts(scenes: SceneParameters) -> list[int]:
    return [int(count) for count in scenes.present.sum(dim=1)]


def _all_scenes(scenes: StackScenes) -> SceneParameters:
    return scenes.parameters(list(range(len(scenes))))
