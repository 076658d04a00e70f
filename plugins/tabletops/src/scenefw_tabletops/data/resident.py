"""Table-top scenes made once, in several processes, and kept on the devices that ask for them."""

from __future__ import annotations

import torch
from rich.progress import track

from scenefw.core.errors import ConfigError
from scenefw.core.labelling_protocols import TabletopSource
from scenefw.renderers.mesh_raycaster import MeshRaycaster
from scenefw.renderers.tables import PreparedTable, Tables, prepared
from scenefw_sweeps.local import Local
from scenefw_tabletops.data.table_scenes import TabletopScenes

_FEW = 16  # scenes that are made sooner than processes start


class ResidentScenes:
    """All scenes of a source on a device, about 3 MB each.

    Args:
        source: the scenes; its renderer casts rays at their triangles.
        workers: processes that make them, -1 = one per core.

    Raises:
        ConfigError: the renderer is another one.
    """

    def __init__(self, source: TabletopScenes, workers: int = -1) -> None:
        if not isinstance(source.renderer, MeshRaycaster):
            raise ConfigError(
                f"{type(source.renderer).__name__} renders no batches on a device; give "
                "renderer mesh_raycaster, or dataset=tabletop_views and tabletop_maps"
            )
        self.source, self.renderer = source, source.renderer
        pool = Local(workers)
        self.parallel = pool if len(source.numbers) > _FEW else Local(1)
        self._tables: dict[torch.device, Tables] = {}

    def on(self, device: torch.device) -> Tables:
        """The scenes, in the order of the source."""
        if device not in self._tables:
            self._tables[device] = self.renderer.tables(self._make(), device)
        return self._tables[device]

    def _make(self) -> list[PreparedTable]:
        source = self.source
        jobs = [(source.scenes, number, source.seed) for number in source.numbers]
        return list(track(self.parallel.each(_prepare, jobs), "scenes", total=len(jobs)))


def _prepare(job: tuple[TabletopSource, int, int]) -> PreparedTable:
    scenes, number, seed = job
    return prepared(scenes.geometry(scenes.generate(number, seed)))
