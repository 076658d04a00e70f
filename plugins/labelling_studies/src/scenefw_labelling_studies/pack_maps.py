"""Fuses the height maps of many scenes and packs them into one file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from rich.progress import track

from scenefw.core.errors import ConfigError
from scenefw_labelling_studies.packed_maps import packed, save_maps

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.protocols import Workers


class MapArrays(Protocol):
    """Whole labelled maps of scenes, as arrays (`maps` of group `dataset`, `tabletop_*maps`)."""

    @property
    def classes(self) -> Sequence[str]:
        """Names by class id."""

    def __len__(self) -> int:
        """Number of maps."""

    def arrays(self, scene: int) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Colour (V, V, 3) uint8, heights (V, V) float32 and labels (V, V) int8 of a map."""

    def facts(self) -> dict[str, Any]:
        """How they were made, as plain data."""


class PackMaps:
    """Writes the maps of both splits, those of validation first, as many as fit (`run=pack_maps`).

    Args:
        train: maps to learn from; None = the chosen data set has none.
        validation: maps of other scenes to watch the training by.
        path: the file; `dataset=tabletop_fused_maps_packed` trains from it alone.
        parallel: where maps are fused.
        megabytes: its largest size; None = any.

    Raises:
        ConfigError: no maps, or splits of different classes.
    """

    def __init__(
        self,
        train: MapArrays | None,
        validation: MapArrays | None,
        path: str | Path,
        parallel: Workers,
        megabytes: float | None = 40.0,
    ) -> None:
        if train is None or validation is None:
            raise ConfigError(
                "run=pack_maps needs a data set of height maps; give dataset=tabletop_fused_maps, "
                "or tabletop_maps for true maps"
            )
        if tuple(train.classes) != tuple(validation.classes):
            raise ConfigError(
                f"classes of training {list(train.classes)} and of validation "
                f"{list(validation.classes)} differ; give two splits of one data set"
            )
        self.splits = {"validation": validation, "train": train}
        self.path, self.megabytes, self.parallel = Path(path), megabytes, parallel

    def run(self) -> dict[str, float]:
        """Fuses and packs; returns the number of maps of each split and the size (MB)."""
        train = self.splits["train"]
        packed_counts = save_maps(
            self.path, self._packed(), train.classes, self.megabytes, train.facts()
        )
        map_counts = {split: len(maps) for split, maps in self.splits.items()}
        size = self.path.stat().st_size / 1e6
        for split, count in map_counts.items():
            print(f"{split}: {packed_counts.get(split, 0)} of {count} maps")
        print(f"{self.path}: {size:.1f} MB", flush=True)
        return {
            **{f"maps/{split}": float(packed_counts.get(split, 0)) for split in map_counts},
            "mb": size,
        }

    def _packed(self) -> Iterator[tuple[str, bytes]]:
        jobs = [(split, maps, s) for split, maps in self.splits.items() for s in range(len(maps))]
        yield from track(self.parallel.each(_pack, jobs), "packing maps", total=len(jobs))


def _pack(job: tuple[str, MapArrays, int]) -> tuple[str, bytes]:
    split, maps, scene = job
    return split, packed(*maps.arrays(scene))
