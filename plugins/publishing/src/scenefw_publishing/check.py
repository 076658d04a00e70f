"""Checks a data set of scenes: are they at rest, do objects intersect, what do they contain."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from scenefw.core.errors import ConfigError
from scenefw.core.files import write_text
from scenefw.core.protocols import Engine
from scenefw.core.types import Scene
from scenefw.data.batches.stacks import data_file
from scenefw.scenes.storage import StoredScenes, load_manifest, load_scenes
from scenefw_publishing.scene_checks import deepest_penetration
from scenefw_simulators.generation import statistics


class Check:
    """Measures scenes spread evenly over a data set and writes a page and a figure about it.

    Penetration is computed from the superquadrics themselves, without the simulator; rest by
    simulating on from a fresh world.

    Args:
        engine: simulates.
        scenes: the `.npz` of a data set, or the name of a shipped one; None means stacks_v2.
        number: scenes to check.
        steps: simulated steps that they must stand.
        page: the Markdown page to write, its figure beside it.

    Raises:
        ConfigError: nothing to check.
        StorageError: the data set is missing or damaged.
    """

    def __init__(
        self,
        engine: Engine,
        scenes: str | None = None,
        number: int = 200,
        steps: int = 1000,
        page: str = "outputs/dataset.md",
    ) -> None:
        if number < 1 or steps < 1:
            raise ConfigError(f"run.number = {number}, run.steps = {steps}: expected at least 1")
        self.engine = engine
        self.scenes = data_file(scenes)
        self.number = number
        self.steps = steps
        self.page = Path(page)

    def run(self) -> dict[str, float]:
        """Measures and writes; returns the figures in metres, radians and shares."""
        from rich.progress import track

        stored = load_scenes(self.scenes)
        if not isinstance(stored, StoredScenes):
            raise ConfigError(f"{self.scenes} holds meshes; run=check measures superquadrics")
        if not len(stored):
            raise ConfigError(f"{self.scenes} holds no scene to check")
        number = min(self.number, len(stored))
        rows = np.linspace(0, len(stored) - 1, number).astype(int)
        measured = np.array([self._measure(stored.scene(row)) for row in track(rows, "scenes")])
        figures = {**statistics.summary(stored), "checked": float(number)}
        for name, values in zip(("penetration", "shift", "turn"), measured.T, strict=True):
            figures |= {f"{name}_median": float(np.median(values)), f"{name}_max": values.max()}
            figures[f"{name}_p99"] = float(np.percentile(values, 99))
        figures = {name: float(value) for name, value in figures.items()}
        picture = self.page.with_suffix(".png")
        statistics.draw(stored, picture)
        write_text(self.page, self._text(stored, figures, picture.name))
        print(self.page)
        return figures

    def _measure(self, scene: Scene) -> tuple[float, float, float]:
        """Deepest penetration (m), furthest move (m) and largest turn (rad) of an object."""
        self.engine.reset()
        handles = [self.engine.add(item) for item in scene.objects]
        self.engine.simulate(self.steps)
        shift = turn = 0.0
        for item, handle in zip(scene.objects, handles, strict=True):
            after = self.engine.pose(handle)
            displacement = np.linalg.norm(after.position - item.pose.position)
            cosine = min(1.0, abs(float(after.quaternion @ item.pose.quaternion)))
            shift, turn = max(shift, float(displacement)), max(turn, float(2 * np.arccos(cosine)))
        return deepest_penetration(scene), shift, turn

    def _text(self, stored: StoredScenes, figures: Mapping[str, float], picture: str) -> str:
        manifest = load_manifest(self.scenes)
        versions = ", ".join(f"{k} {v}" for k, v in manifest.get("versions", {}).items())
        counts = ", ".join(f"{n} with {k}" for k, n in manifest["objects"].items())
        parts = ", ".join(f"{n} {k}" for k, n in manifest["split"].items())
        size = self.scenes.stat().st_size / 1e6
        rows = "\n".join(
            f"| {label} | {figures[f'{name}_median'] * scale:.2f} | "
            f"{figures[f'{name}_p99'] * scale:.2f} | {figures[f'{name}_max'] * scale:.2f} |"
            for label, name, scale in (
                ("deepest penetration of two objects or floor (mm)", "penetration", 1e3),
                (f"furthest move of an object in {self.steps} more steps (mm)", "shift", 1e3),
                (f"largest turn of an object in {self.steps} more steps (degrees)", "turn", 57.296),
            )
        )
        return _PAGE.format(
            name=self.scenes.name,
            kept=len(stored),
            attempts=manifest.get("attempts", "?"),
            seed=manifest.get("seed", "?"),
            counts=counts,
            parts=parts,
            shapes=_shapes(manifest.get("shapes", {})),
            size=size,
            versions=versions,
            commit=manifest.get("commit") or "not recorded",
            number=int(figures["checked"]),
            rows=rows,
            picture=picture,
            differences=_differences(manifest.get("recipe", {})),
        )


_PAGE = """# The data set of superquadric stacks

`{name}` ({size:.1f} MB): {kept} scenes of {attempts} attempts, seed {seed}. Objects: {counts}.
Parts, by scene: {parts}.{shapes} Made with {versions}; commit {commit}.

    python -m scenefw run=generate size.attempts={attempts}  # regenerates it
    python -m scenefw run=check             # measures it and writes this page

![what is in it]({picture})

## Do the scenes stand, and do objects cut into each other?

{number} scenes spread evenly over the set. Penetration is computed from the superquadrics alone
(for convex bodies the least overlap of their shadows over all directions; negative = a gap), the
other two by simulating the stored scene on from a fresh world.

| over scenes | median | 99 % | largest |
| --- | --- | --- | --- |
{rows}
{differences}"""

_DIFFERENCES = """
## What differs from algorithm 1 of the thesis

- A drop ends when everything is at rest, or when the new object has left the limits, instead of
  after {max_steps} steps always, which stay the limit. At rest: all objects slower than
  {linear_speed} m/s and {angular_speed} rad/s for {quiet_steps} steps in a row.
- A drop counts only if *all* objects rest inside the limits; else the new object is taken out and
  the others are put back where they were. The thesis asks this of the new object alone.
- The finished scene, rounded to float32 as stored, is simulated on from a fresh world,
  {check_steps} steps at a time and at most {checks} times, until nothing moves more than
  {max_shift} m or {max_turn} rad in that time; a scene that never stands is given up.
- The number of objects to place is drawn uniformly from {minimum} to {maximum}; the thesis goes for
  the maximum and keeps what has the minimum.
- Rotations are uniform, which three uniform angles are not. Exponents are log-uniform, so that not
  nearly all shapes are boxes.
- Angular damping is {damping} / s (Bullet's default: 0.04), so that round shapes come to rest.
- Collision hulls keep to a band {hull_tolerance} m wide about the superquadrics and are drawn in by
  Bullet's collision margin of {margin} m, which would otherwise hold two objects two margins apart.

The same seed gives the same scenes with any number of workers. What is drawn is rounded to float32,
and hulls to 10 nanometres, before they reach Bullet, so that the last bits, in which processors
differ, don't matter. Another build of Bullet may let some scenes fall otherwise; the stored file
stays valid, and the test that compares says which version it wants.
"""


def _shapes(counts: Mapping[str, int]) -> str:
    """How many shapes each part has; empty if the manifest doesn't say."""
    if not counts:
        return ""
    parts = ", ".join(f"{n} {name}" for name, n in counts.items() if n and name != "shared")
    return f" Different shapes: {parts}; {counts['shared']} in more than one part."


def _differences(recipe: Mapping[str, Any]) -> str:
    """How the generator differs from the thesis, with its settings; empty if unknown."""
    settings = {**recipe, **recipe.get("engine", {})}
    try:
        return _DIFFERENCES.format_map(settings)
    except KeyError:  # made by another generator or engine
        return ""
