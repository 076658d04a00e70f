"""Fuses the height maps of many scenes and packs them into one file to carry."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from rich.progress import track

from scenefw.core.errors import ConfigError
from scenefw.data.map_crops import MapCrops, StoredMaps
from scenefw.data.packed_maps import packed, save_maps
from scenefw.data.segmentation import SegmentationData


class PackMaps:
    """Writes the maps of both splits, those of validation first, as many as fit (`run=pack_maps`).

    Args:
        data: crops of maps that a source has (dataset tabletop_fused_maps or tabletop_maps).
        path: the file; `dataset=tabletop_fused_maps_packed` trains from it alone.
        megabytes: most that it may have; null = any.
        workers: processes, -1 = one per core.

    Raises:
        ConfigError: other data, or no process.
    """

    def __init__(
        self,
        data: SegmentationData,
        path: str | Path,
        megabytes: float | None = 40.0,
        workers: int = -1,
    ) -> None:
        if workers == 0:
            raise ConfigError(
                "run.workers = 0: expected a number of processes, or -1 for all cores"
            )
        self.splits = {"validation": _maps(data.validation), "train": _maps(data.train)}
        self.path, self.megabytes, self.workers = Path(path), megabytes, workers

    def run(self) -> dict[str, float]:
        """Fuses and packs; returns the number of maps of each split and the size (MB)."""
        train = self.splits["train"]
        held = save_maps(self.path, self._made(), train.classes, self.megabytes, train.facts())
        wanted = {split: len(maps) for split, maps in self.splits.items()}
        size = self.path.stat().st_size / 1e6
        for split, count in wanted.items():
            print(f"{split}: {held.get(split, 0)} of {count} maps")
        print(f"{self.path}: {size:.1f} MB", flush=True)
        return {**{f"maps/{split}": float(held.get(split, 0)) for split in wanted}, "mb": size}

    def _made(self) -> Iterator[tuple[str, bytes]]:
        from joblib import Parallel, delayed

        jobs = [(split, maps, s) for split, maps in self.splits.items() for s in range(len(maps))]
        # joblib's own way with one worker is a plain loop
        work = Parallel(n_jobs=self.workers, return_as="generator", pre_dispatch="n_jobs")
        made = work(delayed(_pack)(*job) for job in jobs)
        yield from track(made, "packing maps", total=len(jobs))


def _pack(split: str, maps: StoredMaps, scene: int) -> tuple[str, bytes]:
    return split, packed(*maps.arrays(scene))


def _maps(samples: object) -> StoredMaps:
    maps = samples.maps if isinstance(samples, MapCrops) else None
    if not isinstance(maps, StoredMaps):
        raise ConfigError(
            "run=pack_maps packs maps that a source has; give dataset=tabletop_fused_maps, or "
            "tabletop_maps for true maps"
        )
    return maps
