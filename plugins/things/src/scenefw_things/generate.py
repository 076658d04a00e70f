"""Generates scenes of things in several processes, in shards that survive a kill."""

from __future__ import annotations

import json
from functools import partial

import numpy as np

from scenefw.core.files import require_name, require_writable, write_text
from scenefw.core.made_of import settings_of
from scenefw.core.protocols import Workers
from scenefw.core.settings import COUNT
from scenefw.core.versions import installed
from scenefw_simulators.generation.shards import Shard, Shards
from scenefw_things.scenes.generator import ThingScenes
from scenefw_things.scenes.scene import OBJECT, load_scenes, save_scenes

_DECIDING = ("scenefw", "pybullet", "numpy", "scipy")  # packages that scenes depend on


class GenerateThings:
    """Runs attempts 0 .. attempts - 1 and writes the scenes that succeed as numbers alone.

    Finished shards lie in a folder named by a digest of all that decides what comes out, so that a
    rerun after a kill continues. Beside the file `NAME.npz` lies `NAME.json` with these settings.

    Args:
        source: makes the scenes.
        parallel: where shards are made.
        attempts: how many are tried.
        seed: of the data set.
        shard_size: attempts per shard.
        shards: folder of the shards of all data sets.
        output: where the data set goes.
        name: of its file, without suffix.

    Raises:
        ConfigError: a count is below one.
        StorageError: a folder can't be written.
    """

    def __init__(
        self,
        source: ThingScenes,
        parallel: Workers,
        attempts: int = 10_000,
        seed: int = 0,
        shard_size: int = 50,
        shards: str = "outputs/scenes",
        output: str = "outputs",
        name: str = "things",
    ) -> None:
        COUNT.require(attempts=attempts, shard_size=shard_size)
        self.source, self.parallel = source, parallel
        self.attempts, self.seed, self.shard_size = attempts, seed, shard_size
        self.shards, self.output, self.name = shards, output, require_name(name, "run.name")

    def run(self) -> dict[str, float]:
        """Generates missing shards and merges all; returns the numbers of scenes and things."""
        facts = {"seed": self.seed, "recipe": settings_of(self.source),
                 "versions": installed(_DECIDING)}  # fmt: skip
        target = require_writable(self.output) / f"{self.name}.npz"
        shards = Shards(self.shards, facts, self.attempts, self.shard_size, load_scenes, "things-")
        missing = shards.missing()
        work = partial(make_shard, self.source, self.seed)
        for done, _ in enumerate(self.parallel.each(work, missing, ordered=False), start=1):
            print(f"{done} of {len(missing)} shards", flush=True)
        scenes = [scene for path, _ in shards.all() for scene in load_scenes(path)]
        save_scenes(target, scenes)
        write_text(target.with_suffix(".json"), json.dumps(facts, sort_keys=True, indent=2) + "\n")
        print(target)
        counts = [sum(item.role == OBJECT for item in scene.items) for scene in scenes]
        return {
            "attempts": float(self.attempts),
            "scenes": float(len(scenes)),
            "things": float(np.sum(counts)),
        }


def make_shard(source: ThingScenes, seed: int, shard: Shard) -> int:
    """Runs attempts start .. stop - 1 and writes their scenes; returns their number."""
    path, (start, stop) = shard
    attempts = (source.generate(index, seed) for index in range(start, stop))
    scenes = [scene for scene in attempts if scene is not None]
    save_scenes(path, scenes)
    return len(scenes)
