"""Fits what overlap is to be expected of a shape: python -m benchmarks.fit_confidence MESHES.

Of each object of an image that `run=predict` finds, both its superquadric or hull and its learned
shape are judged, so that the calibration can also say which of them it should have. Images are of
household things of the validation family, as each sensor sees them, as in `experiment=household
split=val`, whose input MESHES is, and of validation stacks of superquadrics, exact, and with noise
of a Kinect and of a stereo camera. Writes the calibration, and prints how far off it is in scenes
that it was not fitted to, and how far the one is that ships.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import spearmanr

from scenefw import config, plugins
from scenefw.core.errors import InputError
from scenefw.core.files import write_text
from scenefw.core.versions import versions
from scenefw.execution.build import Builder
from scenefw.perception.estimate.shape_cues import CUES
from scenefw.postprocessing.confidence import ExpectedOverlap
from scenefw_single_view_benchmarks.confidence import true_ious

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from scenefw.core.types import Float64, SceneEstimate
    from scenefw.perception.estimate.assembly import SceneAssembly
    from scenefw_annotated_views.annotations import AnnotatedView

_FOLDS = 5
_FAMILIES = ("stacks", "stacks_kinect", "stacks_ramps")


@dataclass
class Recorder:
    """Keeps what an assembly judges: the scene as it is, and with shells."""

    assembly: SceneAssembly
    pairs: list[tuple[SceneEstimate, SceneEstimate]] = field(default_factory=list)

    def __post_init__(self) -> None:
        judge = self.assembly.alternatives

        def recorded(*words: object) -> tuple[SceneEstimate, SceneEstimate]:
            self.pairs.append(judge(*words))  # type: ignore[arg-type]
            return self.pairs[-1]

        object.__setattr__(self.assembly, "alternatives", recorded)


def views(meshes: str, scenes: int) -> Iterator[tuple[str, int, AnnotatedView]]:
    """Name of its kind, number of its scene, and each view."""
    settings = ["experiment=household", f"input={meshes}", "split=val", "device=cpu"]
    household = Builder(config.compose([*settings, f"size.test_scenes={scenes}"]))
    for stratum, sensors in household.build("evaluation.strata").items():
        for sensor, part in sensors.items():
            for scene in range(len(part)):
                yield f"{stratum} things, {sensor}", scene, next(iter(part.views(scene, 1)))
    stacks = Builder(config.compose(["experiment=confidence", f"size.test_scenes={scenes}"]))
    families = stacks.build("evaluation.families")
    for name in _FAMILIES:
        for scene in range(len(families[name])):
            yield name, scene, next(iter(families[name].views(scene, 1)))


def fitted(numbers: Float64, overlaps: Float64) -> ExpectedOverlap:
    """The calibration for numbers (N, K) and overlaps (N,)."""
    return ExpectedOverlap.fitted(CUES, numbers, overlaps)


def errors(expected: Float64, overlaps: Float64) -> str:
    """Bias, root mean square and rank correlation."""
    off = expected - overlaps
    rank = spearmanr(expected, overlaps)[0]
    return f"bias {off.mean():+.3f}, error {np.sqrt((off**2).mean()):.3f}, rank {rank:.2f}"


def main() -> None:
    """Fits, prints and writes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes")
    parser.add_argument("--scenes", type=int, default=10, help="of each kind")
    parser.add_argument("--output", type=Path, default=Path("calibration.json"))
    options = parser.parse_args()
    plugins.activate()
    pipeline = Builder(config.compose(["run=predict", "input=none", "device=cpu"])).build(
        "reconstructor"
    )
    recorder = Recorder(pipeline.assembly)
    numbers, overlaps, scenes, kinds = [], [], [], []
    for kind, scene, view in views(options.meshes, options.scenes):
        if kind not in kinds:
            print(f"# {kind}", flush=True)
        recorder.pairs.clear()
        try:
            pipeline.reconstruct(pipeline.observe(view.frame), first_only=True)
        except InputError:
            continue  # as the benchmark counts it: refused
        for estimate in (e for pair in recorder.pairs for e in pair):
            for item, overlap in zip(estimate.objects, true_ious(estimate, view), strict=True):
                numbers.append([item.cues[name] for name in CUES])
                overlaps.append(overlap)
                scenes.append(scene)
                kinds.append(kind)
    values, truth, fold = np.array(numbers), np.array(overlaps), np.array(scenes) % _FOLDS
    held_out = np.empty(len(truth))
    for number in range(_FOLDS):
        rows: NDArray[np.bool_] = fold == number
        held_out[rows] = fitted(values[~rows], truth[~rows])(values[rows])
    shipped = pipeline.assembly.calibration(values)
    print(f"# {len(truth)} shapes; in scenes that were held out: {errors(held_out, truth)}")
    print(f"# with the calibration that ships: {errors(shipped, truth)}")
    about = {
        "about": "Cues about shapes to their expected IoU: python -m benchmarks.fit_confidence "
        f"MESHES --scenes {options.scenes}",
        "families": sorted(set(kinds)),
        "objects": len(truth),
        "commit": versions().get("commit"),
    }
    content = {**about, **fitted(values, truth).content}
    write_text(options.output, json.dumps(content, indent=1) + "\n")
    print(options.output)


if __name__ == "__main__":
    main()
