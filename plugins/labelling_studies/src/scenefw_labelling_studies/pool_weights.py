"""Weights of the hybrid's pool, estimated on scenes that no test uses."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core import rng
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.labels import known_mask
from scenefw.labelling.pooling import DOUBT, Pool, check_doubt
from scenefw_labelling_studies.curves import frame_counts
from scenefw_labelling_studies.measures import of_weights
from scenefw_labelling_studies.pool_fitting import fit_pool
from scenefw_labelling_studies.results import MAP_BASED, VIEW_BASED
from scenefw_tabletops.data.fused_maps import in_turns

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.height_maps import HeightMap
    from scenefw.core.measures import Measure
    from scenefw.core.protocols import Noise
    from scenefw.core.types import Float32, Int32
    from scenefw.labelling.reconstruction import Reconstruction
    from scenefw_labelling_studies.bench import Bench

_MAYBE = 0.1  # a vertex may be drawn for a class that is more probable than this
Tracker = Callable[[Sequence[int], str], Iterable[int]]


@dataclass(frozen=True)
class WeightsResult:
    """Weights of the pool and its accuracy with them, averaged over classes.

    Args:
        pool: with the weights found.
        accuracy: mean over classes of the share of their vertices labelled right, of views, map and
            pool. A class's vertices are its own and those that views or map may take for it.
        vertices: number of vertices that they were estimated on.
        scenes: number of scenes.
    """

    pool: Pool
    accuracy: dict[str, float]
    vertices: int
    scenes: int

    @property
    def figures(self) -> dict[str, float]:
        """Weights, accuracies and numbers."""
        accuracy = {f"accuracy/{name}": value for name, value in self.accuracy.items()}
        counts = {"vertices": float(self.vertices), "scenes": float(self.scenes)}
        return self._weights() | accuracy | counts

    @property
    def measures(self) -> Mapping[str, Measure]:
        """Units, digits and published values of the figures."""
        return of_weights(self._weights())

    def _weights(self) -> dict[str, float]:
        weights = {
            f"{part}/{name}": value
            for part, values in self.pool.parts.items()
            for name, value in asdict(values).items()
        }
        return weights | {"doubt": self.pool.doubt}


class HybridWeights:
    """Estimates the weights from views, maps and true labels, after growing numbers of frames.

    For each class, vertices are drawn from those that belong to it or that views or map may take
    for it, the ones its IoU is computed over: the two differ most along the outlines of objects,
    where few of all vertices lie. Vertices that are given another class by a narrow margin are
    included, as the pool may give them this one.

    Args:
        bench: runs `view_based` and `map_based` on scenes that no network was trained on.
        reconstruction: that of the hybrid.
        frames: of each sequence.
        steps: how many numbers of frames are sampled, evenly spaced.
        first: an earlier number of frames, sampled too; None = none.
        vertices: drawn for each class, scene and number of frames.
        seed: of the draw.
        noise: settings of noise that scenes take in turn, as `in_turns`; None: the bench's noise.
        doubt: of the pool.

    Raises:
        ConfigError: a strategy is missing, both kinds of noise are given, there are fewer scenes
            than noises, or the doubt is not between 0 and 1.
    """

    def __init__(
        self,
        bench: Bench,
        reconstruction: Reconstruction,
        frames: int,
        steps: int = 5,
        first: int | None = None,
        vertices: int = 500,
        seed: int = 0,
        noise: Mapping[str, Mapping[str, Noise]] | None = None,
        doubt: float = DOUBT,
    ) -> None:
        missing_strategies = {VIEW_BASED, MAP_BASED} - set(bench.strategies)
        if missing_strategies:
            raise ConfigError(
                f"estimating the hybrid's weights needs {' and '.join(sorted(missing_strategies))} "
                "too; give labelling=[view_based,map_based]"
            )
        self.bench = bench
        self.reconstruction = reconstruction
        self.counts = frame_counts(frames, steps, first)
        self.vertices = vertices
        self.seed = seed
        self.noise = noise or None
        self.doubt = check_doubt(doubt)
        if noise and bench.noise:
            raise ConfigError(
                "scenes have one noise or use several in rotation; with noise=... give "
                "noise_per_scene=none"
            )
        if noise and len(bench.scenes) < len(noise):
            raise ConfigError(
                f"{len(bench.scenes)} scenes can't use {len(noise)} noises in rotation; give "
                f"size.validation_tables={len(noise)} or more, or noise_per_scene=none"
            )

    def run(self, track: Tracker = lambda scenes, _: scenes) -> WeightsResult:
        """The weights; `track` wraps the loop in a progress bar."""
        scenes = range(len(self.bench.scenes))
        parts = []
        for scene in track(scenes, "scenes"):
            truth = self.bench.scenes.truth(scene)
            if truth.labels is None:
                raise InputError(f"scene {scene} has no true labels to calibrate on")
            noise = None if self.noise is None else in_turns(self.noise, scene)
            for snapshots in self.bench.run(scene, self.counts, noise):
                maps = [snapshots[name].height_map for name in (VIEW_BASED, MAP_BASED)]
                samples = self._draw(maps, truth.labels, scene, snapshots[VIEW_BASED].frames)
                parts.append(self._samples(maps, truth.labels, samples))
        views, of_map, well, labels, drawn_for = (
            np.concatenate(part, axis=-1) for part in zip(*parts, strict=True)
        )
        pool = fit_pool(views, of_map, well, labels, drawn_for, self.doubt)
        pooled = pool(views, of_map, well)
        accuracy = {
            name: balanced_accuracy(probabilities.argmax(axis=0), labels, drawn_for)
            for name, probabilities in (("views", views), ("map", of_map), ("pool", pooled))
        }
        return WeightsResult(pool, accuracy, len(labels), len(scenes))

    def _draw(
        self, maps: Sequence[HeightMap], truth: Int32, scene: int, frames: int
    ) -> tuple[NDArray[np.intp], Int32]:
        """Indices of seen vertices drawn for each class, and the class each is drawn for."""
        random = rng.generator(self.seed, scene, frames)
        usable = maps[0].seen & (truth >= 0)
        experts = [_probabilities(m) for m in maps]
        indices, drawn_for = [], []
        for label in np.unique(truth[truth >= 0]):
            maybe = (known_mask(p) & (p[label] > _MAYBE) for p in experts)
            concerned = np.any([truth == label, *maybe], axis=0)
            (places,) = np.nonzero((usable & concerned).ravel())
            indices.append(random.permutation(places)[: self.vertices])
            drawn_for.append(np.full(len(indices[-1]), label, dtype=np.int32))
        return np.concatenate(indices), np.concatenate(drawn_for)

    def _samples(
        self,
        maps: Sequence[HeightMap],
        truth: Int32,
        samples: tuple[NDArray[np.intp], Int32],
    ) -> tuple[Float32, Float32, Float32, Int32, Int32]:
        """Their probabilities (C, N) of views and map, reconstruction, truth, class drawn for."""
        indices, drawn_for = samples
        views, of_map = (_probabilities(m).reshape(-1, truth.size)[:, indices] for m in maps)
        well = self.reconstruction.of(maps[0]).reshape(-1)[indices]
        return views, of_map, well, truth.reshape(-1)[indices], drawn_for


def balanced_accuracy(
    predicted: NDArray[np.intp], truth: Int32, drawn_for: Int32 | None = None
) -> float:
    """Mean over classes of the share labelled right, of vertices drawn for it (None: of it)."""
    counted = truth if drawn_for is None else drawn_for
    right = predicted == truth
    return float(np.mean([np.mean(right[counted == c]) for c in np.unique(counted)]))


def _probabilities(height_map: HeightMap) -> Float32:
    if height_map.probabilities is None:
        raise InputError("a strategy's map has no probabilities; the hybrid can't pool it")
    return height_map.probabilities
