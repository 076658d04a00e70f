"""One test scene in several random views."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from scenefw.core import rng

if TYPE_CHECKING:
    from scenefw.data.batches.stacks import SceneSet
    from scenefw.data.batches.views import ViewBatch, ViewMaker


@dataclass(frozen=True)
class SceneInViews:
    """One scene in several views.

    Args:
        index: of the scene in its data set.
        batches: batches of one, a view each.
        codes: seed of codes.
    """

    index: int
    batches: tuple[ViewBatch, ...]
    codes: int

    @classmethod
    def of(
        cls,
        scenes: SceneSet,
        row: int,
        maker: ViewMaker,
        views: int,
        streams: tuple[int, int, int],
        device: str,
    ) -> SceneInViews:
        """Random views of a scene.

        Args:
            scenes: of a split.
            row: of the scene among them.
            maker: makes views.
            views: how many.
            streams: seed, random stream of views, and that of codes.
            device: where views are made.
        """
        seed, of_views, of_codes = streams
        parameters = scenes.parameters([row], device)
        batches = tuple(
            maker.make_one(parameters, rng.generator(seed, of_views, row, view))
            for view in range(views)
        )
        return cls(int(scenes.indices[row]), batches, rng.torch_seed(seed, of_codes, row))
