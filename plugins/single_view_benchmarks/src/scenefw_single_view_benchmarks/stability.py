"""Whether predicted piles stand when they are left to gravity (thesis 5.2.6, figs 5.26, 5.27)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from itertools import product
from typing import Any

import torch

from scenefw.core.batches import Completion
from scenefw.core.errors import ConfigError
from scenefw.core.protocols import (
    Engine,
    MappingMethod,
    Noise,
    Reconstructor,
    Renderer,
    Track,
)
from scenefw.core.types import GridSpec, SceneObject
from scenefw.data.batches.stacks import SceneSet
from scenefw.data.batches.views import ViewMaker, Viewpoints
from scenefw.evaluation.kept_rows import KeptRows, kept_or_made
from scenefw.evaluation.side_by_side import collected
from scenefw.evaluation.stacks.published import published_of
from scenefw.evaluation.stacks.seen_scenes import SceneViews, SeenScene, Streams
from scenefw.evaluation.stacks.visibility import VisibleSurface, visible_share
from scenefw.postprocessing.surfaces import instance_meshes
from scenefw_simulators.body_maker import Bodies, BodyMaker
from scenefw_simulators.motions import motions
from scenefw_single_view_benchmarks.stability_results import TRUTH, Pile, StabilityResult, ViewPiles

_STREAMS = Streams(1, 2, 3)  # the views on which reconstruction is scored


class StabilityEvaluation:
    """Simulates true and predicted scenes, and measures how far their objects move.

    Predictions are simulated as they are, floating and intersecting ones too. An object that a
    superquadric explains is that superquadric, another one its mesh. A pile is stable if all its
    objects' centres move by less than `furthest` and all turn by less than `steepest`.

    Args:
        scenes: of the test split.
        methods: by name; None leaves one out. A method with a grid is given views on it.
        viewpoints: draws cameras.
        renderer: makes depth images of the true TSDF.
        mapping: from depth to partial TSDF.
        engine: simulates.
        noise: disturbs the depth images.
        bodies: makes rigid bodies of objects.
        grid: for methods that have no grid of their own, if none has.
        views: cameras per scene.
        samples: codes per view.
        steps: of each simulation.
        furthest: of stable piles (m).
        steepest: of stable piles (degrees).
        lost: displacement that counts at most (m), as of an object that the simulation loses.
        seed: of cameras, noise and codes.
        device: where volumes and views are computed.
        published: data set of table 5.1 whose figures stand beside these: `superquadrics`, `ycb`,
            or None.
        kept: finished views of an interrupted run; None keeps none.

    Raises:
        ConfigError: no method, no grid, a number below one, or no such data set.
    """

    def __init__(
        self,
        scenes: SceneSet,
        methods: Mapping[str, Reconstructor | None],
        viewpoints: Viewpoints,
        renderer: Renderer,
        mapping: MappingMethod,
        engine: Engine,
        noise: Mapping[str, Noise] | None = None,
        bodies: BodyMaker | None = None,
        grid: GridSpec | None = None,
        views: int = 3,
        samples: int = 3,
        steps: int = 10000,
        furthest: float = 0.2,
        steepest: float = 30.0,
        lost: float = 10.0,
        seed: int = 0,
        device: str = "cpu",
        published: str | None = "superquadrics",
        kept: KeptRows | None = None,
    ) -> None:
        published_of(published)
        self.published, self.kept = published, kept
        self.methods = {name: method for name, method in methods.items() if method is not None}
        if not self.methods or min(views, samples, steps) < 1:
            raise ConfigError(
                f"stability needs methods, views, samples and steps, got {len(self.methods)}, "
                f"{views}, {samples} and {steps}; expected at least 1 of each"
            )
        grids = [method.grid for method in self.methods.values() if method.grid is not None]
        common = next(iter(grids), grid)
        if common is None:
            raise ConfigError("no method has its own grid; give evaluation.grid=${grid}")
        self.grids = {name: method.grid or common for name, method in self.methods.items()}
        self.scenes, self.engine, self.bodies = scenes, engine, bodies or BodyMaker()
        self.views, self.samples, self.steps = views, samples, steps
        self.furthest, self.steepest, self.lost = furthest, steepest, lost
        makers = {
            spec: ViewMaker(spec, viewpoints, renderer, mapping, noise)
            for spec in dict.fromkeys(self.grids.values())
        }
        self.seeing = SceneViews(makers, VisibleSurface(renderer), seed, device)

    @torch.no_grad()
    def run(self, track: Track = lambda pairs, _: pairs) -> StabilityResult:
        """Simulates all views; `track(items, what)` shows a bar of the loop."""
        pairs = list(product(range(len(self.scenes)), range(self.views)))
        piles = kept_or_made(
            self.kept,
            {f"{scene}/{view}": (scene, view) for scene, view in pairs},
            lambda items, on_result: collected(
                self._of_views(items), items, track, "test views", on_result
            ),
            asdict,
            ViewPiles.from_row,
        )
        names = (TRUTH, *self.methods)
        return StabilityResult(
            tuple(piles), names, self.steps, self.furthest, self.steepest, self.published
        )

    def _of_views(self, pairs: Sequence[tuple[int, int]]) -> Iterator[ViewPiles]:
        truths: dict[int, Pile] = {}
        for row, view in pairs:
            if row not in truths:
                truths[row] = self._pile(Bodies(dict(enumerate(self.scenes.objects(row), 1)), {}))
            scene_view = self.seeing.see(self.scenes, row, view, _STREAMS)
            piles: dict[str, tuple[Pile, ...]] = {TRUTH: (truths[row],)}
            for name, method in self.methods.items():
                piles[name] = tuple(self._piles(scene_view, method, self.grids[name]))
            yield ViewPiles(scene_view.index, view, _visibility(scene_view), piles)

    def _piles(
        self, scene_view: SeenScene, method: Reconstructor, grid: GridSpec
    ) -> Iterator[Pile]:
        partial = scene_view.batches[grid].partial
        scenes = method.complete(partial, grid, self.samples, scene_view.codes())
        for scene in {id(item): item for item in scenes}.values():
            yield self._pile(bodies_of(scene, grid, self.bodies))

    def _pile(self, bodies: Bodies) -> Pile:
        items: Sequence[SceneObject] = tuple(bodies.bodies.values())
        body_motions = motions(items, self.engine, self.steps)
        shifts = tuple(min(motion.shift, self.lost) for motion in body_motions)
        divided = sum(bodies.divided(label) for label in bodies.bodies)
        return Pile(
            shifts, tuple(motion.turn for motion in body_motions), len(bodies.left_out), divided
        )


def bodies_of(scene: Completion, grid: GridSpec, maker: BodyMaker) -> Bodies:
    """Rigid bodies of the first view's objects."""
    placed: Mapping[int, Any] = scene.placed[0] if scene.placed else {}
    return maker.make(instance_meshes(scene.tsdf[0], scene.instances[0], grid), placed)


def _visibility(scene_view: SeenScene) -> float:
    surfaces = scene_view.surfaces
    if surfaces is None or surfaces.visible is None:
        return 0.0
    return visible_share(surfaces.full, surfaces.visible)
