"""Generates a data set of scenes in several processes, in shards that survive a kill."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from scenefw.core.errors import StorageError
from scenefw.core.files import require_name, require_writable
from scenefw.core.made_of import settings_of
from scenefw.core.protocols import SceneSource, Workers
from scenefw.core.settings import COUNT
from scenefw.core.versions import installed, versions
from scenefw.scenes.storage import Stored, StoredScenes, concatenate, load_scenes, pack, save_scenes
from scenefw_simulators.generation import statistics
from scenefw_simulators.generation.shards import Shard, Shards

_VERSIONS = {"superquadrics": "_v2", "superquadrics_v1": ""}  # of data sets, by their shapes
_SIMULATORS = ("scenefw", "pybullet", "mujoco", "coacd", "numpy", "scipy")


class Generate:
    """Runs attempts 0 .. attempts - 1 of a data set and merges the scenes that succeed.

    Finished shards lie in a folder named by a digest of everything that decides what comes out, so
    that a rerun after a kill continues, and another setting or version starts afresh. Any number of
    workers makes the same scenes.

    Args:
        source: makes the scenes.
        parallel: where shards are made.
        attempts: how many are tried.
        seed: of the data set.
        shard_size: attempts per shard.
        shards: folder of the shards of all data sets.
        output: where the data set, its manifest and its figure go.
        name: file name of the data set, without suffix; None = as those that ship are called:
            superquadric_SCENE_v2, without _v2 for shapes of v1 and with _SHAPE in its place for
            others, then _SPLIT where all scenes are of one; of meshes SCENE.
        scene: name of the option that makes the scenes.
        shape: name of the option that makes their shapes.

    Raises:
        ConfigError: a count is below one.
        StorageError: a folder can't be written.
    """

    def __init__(
        self,
        source: SceneSource,
        parallel: Workers,
        attempts: int = 10_000,
        seed: int = 0,
        shard_size: int = 50,
        shards: str = "outputs/scenes",
        output: str = "outputs",
        name: str | None = None,
        scene: str | None = None,
        shape: str | None = None,
    ) -> None:
        COUNT.require(attempts=attempts, shard_size=shard_size)
        self.source = source
        self.attempts = attempts
        self.seed = seed
        self.parallel = parallel
        self.shard_size = shard_size
        self.shards = shards
        self.output = output
        self.name = None if name is None else require_name(name, "run.name")
        self.scene = scene or "stacks"
        self.shape = shape or "superquadrics"

    def run(self) -> dict[str, float]:
        """Generates missing shards and merges all; returns the numbers of scenes and objects."""
        facts = {"seed": self.seed, "recipe": settings_of(self.source), "versions": simulators()}
        require_writable(self.output)
        shards = Shards(self.shards, facts, self.attempts, self.shard_size, _finished)
        missing_shards = shards.missing()
        remaining_attempts = sum(stop - start for _, (start, stop) in missing_shards)
        self._generate(missing_shards, completed=self.attempts - remaining_attempts)
        stored = concatenate(load_scenes(path) for path, _ in shards.all())
        target = Path(self.output) / f"{self.name or self._name(stored)}.npz"
        extra = {"attempts": self.attempts, "commit": versions().get("commit")}
        save_scenes(target, stored, extra | facts)
        figures = statistics.summary(stored)
        if isinstance(stored, StoredScenes):
            statistics.draw(stored, target.with_suffix(".png"))
        print(target)
        return {"attempts": float(self.attempts), **figures}

    def _name(self, stored: Stored) -> str:
        """As the data sets that ship are called."""
        if not isinstance(stored, StoredScenes):
            return self.scene
        split = settings_of(self.source).get("split")
        version = _VERSIONS.get(self.shape, f"_{self.shape}")
        return f"superquadric_{self.scene}{version}{f'_{split}' if split else ''}"

    def _generate(self, missing_shards: Sequence[Shard], completed: int) -> None:
        from rich.progress import Progress

        with Progress(*Progress.get_default_columns(), "{task.fields[rate]}") as progress:
            bar = progress.add_task("scenes", total=self.attempts, completed=completed, rate="")
            scene_count = 0
            for attempts, scenes in self._results(missing_shards):
                scene_count += scenes
                elapsed = progress.tasks[0].elapsed or np.inf
                progress.update(bar, advance=attempts, rate=f"{scene_count / elapsed:.1f} scenes/s")

    def _results(self, missing_shards: Sequence[Shard]) -> Iterator[tuple[int, int]]:
        work = partial(make_shard, self.source, self.seed)
        yield from self.parallel.each(work, missing_shards, ordered=False)


def make_shard(source: SceneSource, seed: int, shard: Shard) -> tuple[int, int]:
    """Runs attempts start .. stop - 1 and writes their scenes; returns the numbers of both."""
    path, (start, stop) = shard
    attempts = (source.generate(index, seed) for index in range(start, stop))
    scenes = [scene for scene in attempts if scene is not None]
    save_scenes(path, pack(scenes), {"seed": seed, "attempts": stop - start})
    return stop - start, len(scenes)


def _finished(path: Path) -> Stored:
    """A shard whose manifest, which is written last, is there."""
    if not path.with_suffix(".json").exists():
        raise StorageError(f"{path} is not finished")
    return load_scenes(path)


def simulators() -> dict[str, str]:
    """Versions of the packages that influence the scenes."""
    return installed(_SIMULATORS)
