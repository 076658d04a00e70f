"""Fits the log odds that two regions are one object: python -m benchmarks.fit_merging MESHES.

Household things of the validation family, simulated as each sensor sees them, as in
`experiment=household split=val`; MESHES is its input. Regions are joined as `RegionMerging` does,
but only where they are one object, and every pair that comes up is a sample, as in active learning
of agglomeration (Nunez-Iglesias et al. 2013). Prints the settings of `segmentation.merging`, and
how many pairs they and the network alone have wrong in images that they were not fitted to.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GroupKFold, cross_val_predict

from scenefw import config, plugins
from scenefw.core.errors import InputError
from scenefw.execution.build import Builder
from scenefw.perception.segmentation.region_merging import RegionPairs
from scenefw_single_view_benchmarks.true_things import TrueThings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float64, Int32
    from scenefw.perception.steps import Segmentation

MODEL = LogisticRegression(C=np.inf)  # no penalty: thousands of pairs, four numbers
_NAMES = ("affinity", "same_part", "log_pixels")
_MIN_PURITY = 0.7  # of a region's pixels that show one object, or none: others are both
_FOLDS = 5
_ROUNDS = 3  # the order in which pairs come up depends on the last fit


@dataclass
class MergingRecorder:
    """Stands in for `RegionMerging`: keeps what it is asked of each image, and joins nothing."""

    creases: Segmentation
    images: list[tuple[Int32, Float64, Float64, Int32]] = field(default_factory=list)

    def merged(self, regions: Int32, across: Float64, down: Float64, parts: Int32) -> Int32:
        """The regions themselves."""
        self.images.append((regions, across, down, parts))
        return regions


@dataclass(frozen=True)
class Samples:
    """Measures (N, 3) of pairs, whether they are one object (N), and the scenes (N) they are of."""

    measures: Float64
    is_same: NDArray[np.bool_]
    scenes: NDArray[np.intp]

    def wrong_ratio(self, columns: slice) -> float:
        """Of pairs, as said by a model of some measures that was fitted to other scenes."""
        answers = cross_val_predict(
            MODEL,
            self.measures[:, columns],
            self.is_same,
            groups=self.scenes,
            cv=GroupKFold(_FOLDS),
        )
        return float((answers != self.is_same).mean())


def compared_pairs(
    pairs: RegionPairs, owners: Float64, intercept: float, coefficients: Float64
) -> tuple[list[Float64], list[bool]]:
    """Measures of all pairs that come up while regions are joined, and whether they are one object.

    Args:
        pairs: of an image; joined in place.
        owners: (R, N) pixels of each region that show each object; 0: no object, 1: unknown.
        intercept: of the log odds that say in which order pairs come up.
        coefficients: (3,) likewise.
    """
    measures: list[Float64] = []
    answers: list[bool] = []
    is_rejected = np.zeros(pairs.borders.shape, bool)
    while True:
        table = pairs.measures()
        is_open = (pairs.borders > 0) & ~is_rejected
        odds = np.where(is_open, intercept + table @ coefficients, -np.inf)
        target, source = (int(i) for i in np.unravel_index(odds.argmax(), odds.shape))
        if odds[target, source] == -np.inf:
            return measures, answers
        both = owners[[target, source]]
        objects = both.argmax(axis=1)
        is_clear = (objects > 1) & (both.max(axis=1) > _MIN_PURITY * both.sum(axis=1))
        is_same = bool(objects[0] == objects[1])
        if is_clear.all():
            measures.append(table[target, source])
            answers.append(is_same)
        else:
            is_same = bool(odds[target, source] > 0)
        if is_same:
            pairs.join(target, source)
            owners[target] += owners[source]
            owners[source] = 0
            is_rejected[[target, source]] = is_rejected[:, [target, source]] = False
        else:
            is_rejected[target, source] = is_rejected[source, target] = True


def compared_samples(
    images: list[tuple[tuple[Int32, Float64, Float64, Int32], Int32, int]],
    intercept: float,
    coefficients: Float64,
) -> Samples:
    """Of all images: what `RegionMerging` is asked, true labels (H, W), and the scene's number."""
    measures: list[Float64] = []
    answers: list[bool] = []
    scenes: list[int] = []
    for asked, labels, scene in images:
        pairs, regions = RegionPairs.of(*asked), asked[0]
        step = round(labels.shape[1] / regions.shape[1])
        owners = np.zeros((len(pairs.borders), labels.max() + 2))
        shifted = np.where(labels > 0, labels + 1, labels < 0)[::step, ::step]
        np.add.at(owners, (regions, shifted), 1)
        new_measures, new_answers = compared_pairs(pairs, owners, intercept, coefficients)
        measures += new_measures
        answers += new_answers
        scenes += [scene] * len(new_answers)
    return Samples(np.array(measures), np.array(answers, bool), np.array(scenes))


def main() -> None:
    """Fits and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes")
    parser.add_argument("--scenes", type=int, default=10, help="of each of the two strata")
    options = parser.parse_args()
    plugins.activate()
    settings = ["experiment=household", f"input={options.meshes}", "split=val", "device=cpu"]
    builder = Builder(config.compose([*settings, f"size.test_scenes={options.scenes}"]))
    pipeline = builder.build("evaluation.methods.set_extents")
    segmentation = pipeline.segmentation.step  # of the shared one
    merging = segmentation.merging
    recorder = MergingRecorder(merging.creases)
    object.__setattr__(segmentation, "merging", recorder)
    labels, numbers = [], []
    for sensors in builder.build("evaluation.strata").values():
        for scenes in sensors.values():
            for scene in range(len(scenes)):
                (view,) = scenes.views(scene, 1)
                try:
                    pipeline.segmentation.segment(pipeline.observe(view.frame))
                except InputError:
                    continue  # as the benchmark counts it: refused
                labels.append(TrueThings.of(view, min_pixels=100, voxel=0.006).labels)
                numbers.append(scene)
    images = list(zip(recorder.images, labels, numbers, strict=True))
    intercept = merging.intercept
    coefficients = np.array([getattr(merging, name) for name in _NAMES])
    for _ in range(_ROUNDS):
        samples = compared_samples(images, intercept, coefficients)
        model = MODEL.fit(samples.measures, samples.is_same)
        intercept, coefficients = float(model.intercept_[0]), model.coef_[0]
    same_ratio = samples.is_same.mean()
    print(f"# {len(samples.is_same)} pairs of {len(images)} images, {same_ratio:.0%} one object;")
    print(f"# wrong in images that were held out: {samples.wrong_ratio(slice(3)):.1%},")
    print(f"# by the network alone {samples.wrong_ratio(slice(1)):.1%}")
    print(f"intercept: {intercept:.2f}")
    for name, value in zip(_NAMES, coefficients, strict=True):
        print(f"{name}: {value:.2f}")


if __name__ == "__main__":
    main()
