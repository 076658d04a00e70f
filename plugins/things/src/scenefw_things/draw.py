"""Draws a picture of a library of things."""

from __future__ import annotations

from pathlib import Path

from scenefw.core import rng as streams
from scenefw.core.files import replacing, require_writable
from scenefw.core.settings import COUNT
from scenefw_things.shapes.source import Things
from scenefw_things.sheet import thing_sheet


class DrawThings:
    """Writes `things.png`: a row for each family that a part of the data has.

    Args:
        shapes: the library.
        split: part of the data: train, val, test or final.
        count: things of each family.
        output: folder of the picture.
        seed: of the draws.

    Raises:
        ConfigError: the count is below one, or the library has no such part.
        StorageError: the folder can't be written.
    """

    def __init__(
        self,
        shapes: Things,
        split: str = "train",
        count: int = 5,
        output: str | Path = "outputs",
        seed: int = 0,
    ) -> None:
        COUNT.require(count=count)
        self.shapes, self.split, self.count, self.seed = shapes, split, count, seed
        self.output = require_writable(output)

    def run(self) -> dict[str, float]:
        """Draws the picture; returns the number of families."""
        library = self.shapes.library
        rows = []
        for name in library.names(self.split):
            rng = streams.generator(self.seed, streams.number_of(name))
            rows.append([library.thing_of(name, rng, self.split) for _ in range(self.count)])
        path = Path(self.output) / "things.png"
        with replacing(path) as temporary:
            thing_sheet(rows, self.seed).save(temporary, format="png")
        print(path)
        return {"families": float(len(rows))}
