"""What codes of a network change: variety against views, and ways between codes (thesis 5.3.5)."""

from __future__ import annotations

from itertools import combinations, pairwise
from typing import TYPE_CHECKING

import numpy as np
import torch

from scenefw.core.errors import ConfigError
from scenefw.data.batches.views import ViewMaker, Viewpoints
from scenefw.evaluation.kept_rows import KeptRows
from scenefw.evaluation.scored_scenes import scored_scenes, workers_on
from scenefw.mapping.several_views import fused
from scenefw.metrics.instances import instance_scores
from scenefw.metrics.occupancy import occupancy_iou
from scenefw_several_views.latent_space_results import (
    BLENDED,
    CODES,
    LatentSpaceResult,
    SceneCodes,
)
from scenefw_several_views.scene_in_views import SceneInViews

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from torch import Tensor

    from scenefw.core.batches import Completion
    from scenefw.core.protocols import MappingMethod, Matching, Noise, Renderer, Track
    from scenefw.core.types import Float32
    from scenefw.data.batches.stacks import SceneSet
    from scenefw.perception.completion.volume_network import VolumeNetwork

_VIEWS, _CODES, _ENDS = 31, 32, 33  # random streams


class LatentSpaceEvaluation:
    """Draws codes for a growing number of views, and goes from one code to another.

    The same codes are decoded with the first view of a scene, the first two, and so on. Scenes
    differ by 1 - IoU of what they occupy, and by 1 - IoU of matched instances. If draws are of what
    is possible, the truth is as far from them as they are from each other: nearer draws are too
    sure. The way between two codes, seen from one view, is beside that between the two volumes.

    Args:
        scenes: of a split.
        network: decodes codes.
        viewpoints: draws cameras.
        renderer: makes depth images of the true TSDF.
        mapping: from depth to partial TSDF.
        noise: disturbs the depth images.
        counts: numbers of views.
        samples: codes per scene.
        steps: from one code to another.
        matching: of instances.
        seed: of cameras, noise and codes.
        device: where volumes and views are computed.
        workers: scenes at once; None: on the CPU as many as torch has threads, on a GPU one.
        kept: finished scenes of an interrupted run; None keeps none.

    Raises:
        ConfigError: fewer than two codes or steps, no number of views, or a network without codes.
    """

    def __init__(
        self,
        scenes: SceneSet,
        network: VolumeNetwork,
        viewpoints: Viewpoints,
        renderer: Renderer,
        mapping: MappingMethod,
        noise: Mapping[str, Noise] | None = None,
        counts: Sequence[int] = (1, 2, 3, 4, 5, 6),
        samples: int = 6,
        steps: int = 8,
        matching: Matching | None = None,
        seed: int = 0,
        device: str = "cpu",
        workers: int | None = None,
        kept: KeptRows | None = None,
    ) -> None:
        self.counts = tuple(sorted(set(counts)))
        if not self.counts or self.counts[0] < 1 or min(samples, steps) < 2:
            raise ConfigError(
                f"a latent space needs numbers of views, codes and steps, got {list(counts)}, "
                f"{samples} and {steps}; expected at least 1, 2 and 2"
            )
        if not network.model.latent_size:
            raise ConfigError("this network has no codes to draw; give a checkpoint with some")
        self.grid, self.scenes, self.network = network.grid, scenes, network
        self.samples, self.steps = samples, steps
        self.maker = ViewMaker(self.grid, viewpoints, renderer, mapping, noise)
        self.matching, self.seed, self.device, self.kept = matching, seed, device, kept
        self.workers = workers_on(device, workers)

    def run(self, track: Track = lambda items, _: items) -> LatentSpaceResult:
        """Scores all scenes; `track(items, what)` shows a bar of the loop."""
        scenes = scored_scenes(
            self.score, len(self.scenes), SceneCodes.from_row, track, self.kept, self.workers
        )
        return LatentSpaceResult(tuple(scenes), self.counts, self.samples, self.steps)

    def see(self, row: int) -> SceneInViews:
        """All views of one scene."""
        streams = (self.seed, _VIEWS, _CODES)
        return SceneInViews.of(self.scenes, row, self.maker, self.counts[-1], streams, self.device)

    @torch.no_grad()
    def completions(self, scene_views: SceneInViews, count: int) -> list[Completion]:
        """The scene of the zero code, then those of drawn codes, given the first views."""
        generator = torch.Generator().manual_seed(scene_views.codes)
        size = self.network.model.latent_size
        codes = torch.cat(
            [torch.zeros(1, 1, size), torch.randn(self.samples, 1, size, generator=generator)]
        )
        views = fused([batch.partial for batch in scene_views.batches[:count]], self.grid)
        return self.network.complete_with(views, self.grid, codes)

    @torch.no_grad()
    def between(self, scene_views: SceneInViews) -> list[Completion]:
        """Scenes on the way from one drawn code to another, given the first view."""
        generator = torch.Generator().manual_seed(scene_views.codes ^ _ENDS)
        first, last = torch.randn(2, 1, self.network.model.latent_size, generator=generator)
        shares = torch.linspace(0, 1, self.steps + 1)
        codes = torch.stack([on_sphere(first, last, float(share)) for share in shares])
        return self.network.complete_with(scene_views.batches[0].partial, self.grid, codes)

    def score(self, row: int) -> SceneCodes:
        """Variety and ways of one scene."""
        scene_views = self.see(row)
        truth = scene_views.batches[0].volumes
        occupied = truth.tsdf[0, 0].cpu().numpy() < 0
        true = truth.instances[0].cpu().numpy()
        varieties = {}
        for count in self.counts:
            zero, *samples = self.completions(scene_views, count)
            views = fused([batch.partial for batch in scene_views.batches[:count]], self.grid)
            observed = views.observed[0, 0].cpu().numpy()
            shapes = [_occupied(sample) for sample in samples]
            labels = [sample.instances[0].cpu().numpy() for sample in samples]
            pairs = list(combinations(range(len(samples)), 2))
            varieties[count] = {
                "among": _mean(1 - occupancy_iou(shapes[a], shapes[b]) for a, b in pairs),
                "to_truth": _mean(1 - occupancy_iou(shape, occupied) for shape in shapes),
                "zero_to_truth": 1 - occupancy_iou(_occupied(zero), occupied),
                "instances_among": _mean(
                    self._instance_distance(labels[a], labels[b]) for a, b in pairs
                ),
                "instances_to_truth": _mean(
                    self._instance_distance(instances, true) for instances in labels
                ),
                "seen": _share_seen(shapes, observed),
                "observed": float(observed[occupied].mean()) if occupied.any() else float("nan"),
            }
        return SceneCodes(scene_views.index, varieties, self._ways(scene_views, occupied))

    def _ways(self, scene_views: SceneInViews, truth: np.ndarray) -> dict[str, dict[str, float]]:
        scenes = self.between(scene_views)
        ends = scenes[0].tsdf[0].cpu().numpy(), scenes[-1].tsdf[0].cpu().numpy()
        shares = np.linspace(0, 1, self.steps + 1)
        blended = [(1 - share) * ends[0] + share * ends[1] < 0 for share in shares]
        numbers = [float(scene.instances.unique().count_nonzero()) for scene in scenes]
        return {
            CODES: _way([_occupied(scene) for scene in scenes], truth)
            | {"fewest": min(numbers), "most": max(numbers)},
            BLENDED: _way(blended, truth),
        }

    def _instance_distance(self, labels: np.ndarray, other_labels: np.ndarray) -> float:
        """1 - IoU of matched instances, the mean of both directions."""
        return 1 - _mean(
            instance_scores(a, b, self.matching).iou
            for a, b in ((labels, other_labels), (other_labels, labels))
            if b.any()
        )


def on_sphere(first: Tensor, last: Tensor, share: float) -> Tensor:
    """A code between two, as long as codes of N(0, I) are (spherical interpolation).

    Args:
        first: (..., D).
        last: (..., D).
        share: 0 is the first, 1 the last.
    """
    angle = torch.arccos(
        torch.cosine_similarity(first, last, dim=-1).clamp(-1 + 1e-6, 1 - 1e-6)
    ).unsqueeze(-1)
    a, b = torch.sin((1 - share) * angle), torch.sin(share * angle)
    return (a * first + b * last) / torch.sin(angle)


def _way(shapes: Sequence[np.ndarray], truth: np.ndarray) -> dict[str, float]:
    """Figures of shapes on the way from one code to another; distances are 1 - IoU.

    `length`: the sum of all steps by the distance of both ends, 1 for a way that never turns back.
    `largest`: the largest step by that sum, near 1 where a shape jumps. `ends` and `middle`: how
    far shapes are from the truth there.

    Args:
        shapes: occupancies (X, Y, Z), in their order.
        truth: the true occupancy.
    """
    steps = [1 - occupancy_iou(a, b) for a, b in pairwise(shapes)]
    direct = 1 - occupancy_iou(shapes[0], shapes[-1])
    errors = [1 - occupancy_iou(shape, truth) for shape in shapes]
    return {
        "length": sum(steps) / direct if direct > 0 else float("nan"),
        "largest": max(steps) / sum(steps) if sum(steps) > 0 else float("nan"),
        "ends": (errors[0] + errors[-1]) / 2,
        "middle": errors[len(errors) // 2],
    }


def _share_seen(shapes: Sequence[Float32], observed: np.ndarray) -> float:
    """Of all voxels that not all draws occupy alike, the share that the views saw."""
    frequency = np.mean(shapes, axis=0)
    differ = (frequency > 0) & (frequency < 1)
    return float(observed[differ].mean()) if differ.any() else float("nan")


def _occupied(scene: Completion) -> np.ndarray:
    return np.asarray(scene.tsdf[0].cpu().numpy() < 0)


def _mean(values: object) -> float:
    numbers = list(values)  # type: ignore[call-overload]
    return float(np.mean(numbers)) if numbers else float("nan")
