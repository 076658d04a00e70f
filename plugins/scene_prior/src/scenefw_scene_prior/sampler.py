"""Draws whole scenes that nobody has seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING

from scenefw.api.settings import Settings
from scenefw.core.errors import require_whole
from scenefw_editing.scene import Scene

if TYPE_CHECKING:
    from scenefw_scene_prior.prior import ScenePrior


class Sampler:
    """What `scenefw.load("scenes")` gives.

    Args:
        prior: draws scenes.
        computing: threads compute within what it returns.
    """

    def __init__(
        self,
        prior: ScenePrior,
        computing: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> None:
        self.prior = prior
        self._computing = computing

    @classmethod
    def built(cls, words: Sequence[str]) -> Sampler:
        """The sampler of `run=draw_scenes` with these overrides."""
        settings = Settings(["run=draw_scenes", *words])
        (prior,) = settings.build("run.prior")
        return cls(prior, settings.computing)

    def draw(self, count: int = 1, seed: int = 0) -> list[Scene]:
        """Scenes of superquadrics that stand, as `run=draw_scenes` draws them.

        Args:
            count: of scenes.
            seed: scene i depends on it and on i alone.

        Raises:
            InputError: the count is no whole number from 1 on, or the seed none from 0 on.
            ConfigError: no draw of a scene stands.
        """
        require_whole(count, "count", minimum=1)
        require_whole(seed, "seed")
        with self._computing():
            return [Scene.of(estimate) for estimate in self.prior.scenes(count, seed)]
