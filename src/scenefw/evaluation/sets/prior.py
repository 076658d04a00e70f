"""Whether drawn scenes are like true ones: what they are made of, and whether they stand."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import torch

from scenefw.core import geometry, rng
from scenefw.core.batches import SceneParameters, SeenSetBatch
from scenefw.core.errors import ConfigError
from scenefw.core.types import PlacedShape, Pose, SceneObject
from scenefw.evaluation.sets import prior_references as references
from scenefw.evaluation.sets.prior_results import (
    APART,
    DRAWN,
    GIVEN,
    JITTERED,
    SHUFFLED,
    TRAINING,
    TRUTH,
    PriorResult,
    Sample,
    ViewDraws,
)
from scenefw.evaluation.sets.scene_numbers import (
    descriptor,
    nearest_scene,
    object_numbers,
    quantities,
)
from scenefw.perception.pushing_apart import pushed_apart
from scenefw.scenes.simulation import motions
from scenefw.shapes.superquadric import Superquadric

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.protocols import Engine, Track
    from scenefw.core.training_protocols import TrainedSetFlow
    from scenefw.data.stacks import StackScenes

_REFERENCES, _DRAWS, _GIVEN, _CHOICE = 1, 2, 3, 4  # random streams
_SIZES = (1e-3, 1.0)  # m: half-axes that a simulator can take
_LOST = 10.0  # m: displacement that counts at most
_DENSITY = 500.0  # kg/m^3


class ViewedScenes(Protocol):
    """Training scenes, and views of any scenes (`data.seen_sets.SeenSets`)."""

    scenes: StackScenes

    def views_of(self, scenes: StackScenes, rows: Sequence[int]) -> SeenSetBatch:
        """A view of each scene, always the same."""


class SetPriorEvaluation:
    """Draws scenes without a view, and given views, and compares them with true ones.

    The references learn nothing: `shuffled` scenes are put together from shapes and positions of
    different training scenes, and `jittered` ones are true scenes whose objects are moved a little.
    Drawn scenes count as they are, and pushed apart (`perception.pushing_apart`).
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
        examples: scenes of each kind that are shown, and views with several draws.
        draws: scenes of each kind; as many true ones are chosen; None: all.
        seed: of draws and references.

    Raises:
        ConfigError: a number below its range, or the network doesn't draw whole scenes.
    """

    def __init__(
        self,
        checkpoint: TrainedSetFlow,
        data: ViewedScenes,
        scenes: StackScenes,
        engine: Engine,
        steps: int = 20,
        physics_steps: int = 10000,
        furthest: float = 0.2,
        steepest: float = 30.0,
        shift: float = 0.01,
        turn: float = 5.0,
        examples: int = 4,
        draws: int | None = None,
        seed: int = 0,
    ) -> None:
        if min(steps, physics_steps) < 1 or min(furthest, steepest, shift, turn, examples) < 0:
            raise ConfigError(
                f"set_prior has steps {steps}, physics_steps {physics_steps}, furthest {furthest}, "
                f"steepest {steepest}, shift {shift}, turn {turn}, examples {examples}; expected "
                "positive numbers"
            )
        if not checkpoint.model.draws_hidden:
            raise ConfigError(
                "this network draws nothing without a view; give checkpoints.scenes=FILE of a "
                "training of model=set_flow"
            )
        self.model, self.data, self.scenes, self.engine = checkpoint.model, data, scenes, engine
        self.steps, self.physics_steps = steps, physics_steps
        self.furthest, self.steepest = furthest, steepest
        self.shift, self.turn, self.examples, self.seed = shift, turn, examples, seed
        self.draws = len(scenes) if draws is None else min(draws, len(scenes))

    @torch.no_grad()
    def run(self, track: Track = lambda items, _: items) -> PriorResult:
        """Draws, simulates and compares; `track(items, what)` shows a bar of each loop."""
        chosen = rng.generator(self.seed, _CHOICE).permutation(len(self.scenes))[: self.draws]
        views = [self.data.views_of(self.scenes, [row]) for row in track(chosen.tolist(), "views")]
        rows = list(range(self.draws))
        kinds = self._references(chosen.tolist())
        kinds[DRAWN] = self._drawn(views[0], len(rows))
        kinds[APART] = _apart(kinds[DRAWN])
        singles = [self._given(view, row, 1) for row, view in track([*enumerate(views)], "draws")]
        kinds[GIVEN] = _joined(singles)
        known = object_numbers(_all(self.data.scenes))
        samples = {}
        for kind in (DRAWN, APART, GIVEN, TRUTH, TRAINING, SHUFFLED, JITTERED):
            whole = [objects_of(kinds[kind], row) for row in rows]
            new = nearest_scene(object_numbers(kinds[kind]), known)
            samples[kind] = self._scored(whole, new, track, kind)
        shown = {kind: [kinds[kind]] for kind in (DRAWN, TRUTH, SHUFFLED)}
        first = {kind: _rows(one[0], range(self.examples)) for kind, one in shown.items()}
        several = [
            ViewDraws(_seen_first(view), self._given(view, row, 3), tuple(view.camera[0].tolist()))
            for row, view in enumerate(views[: self.examples])
        ]
        return PriorResult(samples, first, tuple(several), self.scenes.split)

    def _references(self, true_rows: list[int]) -> dict[str, SceneParameters]:
        random, count = rng.generator(self.seed, _REFERENCES), len(true_rows)
        training, true = _all(self.data.scenes), self.scenes.parameters(true_rows)
        chosen = random.permutation(len(self.data.scenes))
        chosen = np.resize(chosen, count)  # fewer training scenes than drawn ones come again
        return {
            TRUTH: true,
            TRAINING: _rows(training, chosen.tolist()),
            SHUFFLED: references.shuffled(training, count, random),
            JITTERED: references.jittered(true, self.shift, self.turn, random),
        }

    def _drawn(self, view: SeenSetBatch, count: int) -> SceneParameters:
        generator = torch.Generator().manual_seed(rng.torch_seed(self.seed, _DRAWS))
        moved = self._on_device(view)
        return _usable(self.model.sample(moved, count, generator, self.steps, given=False))

    def _given(self, view: SeenSetBatch, row: int, count: int) -> SceneParameters:
        generator = torch.Generator().manual_seed(rng.torch_seed(self.seed, _GIVEN, row))
        return _usable(self.model.sample(self._on_device(view), count, generator, self.steps))

    def _on_device(self, view: SeenSetBatch) -> SeenSetBatch:
        device = next(self.model.parameters()).device  # type: ignore[attr-defined]
        return SeenSetBatch(**{name: value.to(device) for name, value in vars(view).items()})

    def _scored(
        self,
        scenes: Sequence[Sequence[SceneObject]],
        new: Any,
        track: Track,
        kind: str,
    ) -> Sample:
        values = [quantities(one) for one in scenes]
        stable, shifts = [], []
        for scene in track(scenes, f"piles, {kind}"):
            found = motions(scene, self.engine, self.physics_steps, until_rest=True)
            stable.append(
                bool(found)
                and all(m.shift < self.furthest and m.turn < self.steepest for m in found)
            )
            moves = [min(m.shift, _LOST) for m in found]
            shifts.append(float(np.mean(moves)) if moves else float("nan"))
        rows = [descriptor(one, known) for one, known in zip(scenes, values, strict=True)]
        return Sample(tuple(values), np.array(rows), np.array(stable), np.array(shifts), new)


def objects_of(scenes: SceneParameters, row: int) -> tuple[SceneObject, ...]:
    """The objects of one scene as rigid bodies."""
    there = scenes.present[row].cpu().numpy()
    fields = (scenes.half_axes, scenes.exponents, scenes.rotations, scenes.positions)
    axes, exponents, rotations, positions = (
        field[row].double().cpu().numpy()[there] for field in fields
    )
    items = []
    for i in range(len(axes)):
        shape = Superquadric(axes[i], exponents[i])
        pose = Pose(positions[i], geometry.quaternion_from_rotation(rotations[i]))
        items.append(SceneObject(shape, pose, _DENSITY * shape.volume()))
    return tuple(items)


def _apart(scenes: SceneParameters) -> SceneParameters:
    """Scenes whose objects are pushed out of each other and out of the floor."""
    positions = scenes.positions.clone()
    for row in range(len(positions)):
        placed = [PlacedShape(one.shape, one.pose) for one in objects_of(scenes, row)]
        moved = [one.pose.position for one in pushed_apart(placed)]
        if moved:
            there = scenes.present[row]
            positions[row, there] = torch.from_numpy(np.array(moved)).to(positions)
    return replace(scenes, positions=positions)


def _usable(drawn: SeenSetBatch) -> SceneParameters:
    """Drawn scenes; objects that are not finite are left out, sizes kept within bounds."""
    scene = _scene(drawn)
    finite = torch.stack(
        [field.isfinite().flatten(2).all(dim=2) for name, field in vars(scene).items()
         if name != "present"]
    ).all(dim=0)  # fmt: skip
    still = finite[..., None]
    nothing = torch.zeros_like(scene.positions)
    eye = torch.eye(3).expand_as(scene.rotations)
    return SceneParameters(
        torch.where(still, scene.half_axes, nothing + 0.01).clamp(*_SIZES),
        torch.where(still, scene.exponents, nothing + 2.0),
        torch.where(still[..., None], scene.rotations, eye),
        torch.where(still, scene.positions, nothing),
        scene.present & finite,
    )


def _scene(batch: SeenSetBatch) -> SceneParameters:
    fields = (batch.half_axes, batch.exponents, batch.rotations, batch.positions, batch.present)
    return SceneParameters(*(field.cpu() for field in fields))


def _seen_first(view: SeenSetBatch) -> SceneParameters:
    """The true scene of a view with its objects in the order of drawn ones: seen, then hidden."""
    order = view.seen[0].int().argsort(descending=True, stable=True).cpu()
    return SceneParameters(*(field[:, order] for field in vars(_scene(view)).values()))


def _all(scenes: StackScenes) -> SceneParameters:
    return scenes.parameters(list(range(len(scenes))))


def _rows(scenes: SceneParameters, rows: Sequence[int]) -> SceneParameters:
    kept = [row for row in rows if row < len(scenes.present)]
    return SceneParameters(*(field[kept] for field in vars(scenes).values()))


def _joined(parts: Sequence[SceneParameters]) -> SceneParameters:
    """Scenes one after the other; absent objects fill up those that have fewer."""
    slots = max(part.present.shape[1] for part in parts)
    padded = []
    for part in parts:
        extra = slots - part.present.shape[1]
        fields = {}
        for name, field in vars(part).items():
            filler = field.new_zeros(len(field), extra, *field.shape[2:])
            if name in ("half_axes", "exponents"):
                filler = filler + 2.0
            fields[name] = torch.cat([field, filler], dim=1)
        padded.append(replace(part, **fields))
    return SceneParameters(
        *(torch.cat([getattr(one, name) for one in padded]) for name in vars(padded[0]))
    )
