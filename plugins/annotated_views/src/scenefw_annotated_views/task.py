"""Renders scenes with masks, poses and visibility, as a data set for other programs."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Hashable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenefw.core.errors import ConfigError
from scenefw.core.files import require_writable, write_text
from scenefw.core.folders import replacing_folder
from scenefw.core.versions import versions

if TYPE_CHECKING:
    from scenefw.core.protocols import Workers
    from scenefw_annotated_views.annotations import AnnotatedScenes, DatasetFormat

_MANIFEST = "export.json"


class ExportDataset:
    """Writes views of scenes in another program's format (`run=export_dataset format=bop`).

    A scene's folder appears when all of it is written. A second run into the same folder makes
    what is missing.

    Args:
        views: scenes and their annotated views.
        format: writes them.
        parallel: where scenes are rendered.
        output: root of the data set.
        count: views of each scene.

    Raises:
        ConfigError: fewer than one view.
    """

    def __init__(
        self,
        views: AnnotatedScenes,
        format: DatasetFormat,  # noqa: A002 - named as the group
        parallel: Workers,
        output: str | Path = "outputs",
        count: int = 5,
    ) -> None:
        if count < 1:
            raise ConfigError(f"run.count = {count}: expected at least 1 view of each scene")
        self.views, self.format, self.parallel = views, format, parallel
        self.output, self.count = Path(output), count

    def run(self) -> dict[str, float]:
        """Writes missing scenes and what all share; returns numbers of scenes, views and objects.

        Raises:
            ConfigError: the folder holds another data set.
            StorageError: it can't be written.
        """
        from rich.progress import Progress

        require_writable(self.output)
        self._claim()
        keys = [self.views.keys(scene) for scene in range(len(self.views))]
        numbers: dict[Hashable, int] = {}
        for key in (key for scene_keys in keys for key in scene_keys):
            numbers.setdefault(key, len(numbers) + 1)
        folders = [self.output / self.views.split / f"{s:06d}" for s in range(len(self.views))]
        jobs = [
            (scene, folder, [numbers[key] for key in keys[scene]])
            for scene, folder in enumerate(folders)
            if not folder.is_dir()
        ]
        work = partial(_write, self.views, self.format, self.count)
        with Progress() as progress:
            completed = len(folders) - len(jobs)
            bar = progress.add_task("scenes", total=len(folders), completed=completed)
            for _ in self.parallel.each(work, jobs, ordered=False):
                progress.update(bar, advance=1)
        self.format.finish(self.output, self.views, numbers)
        return {
            "scenes": float(len(folders)),
            "views": float(len(folders) * self.count),
            "objects": float(sum(map(len, keys))),
            "models": float(len(numbers)),
        }

    def _claim(self) -> None:
        """Says in the folder what it holds."""
        facts = {
            "format": type(self.format).__qualname__,
            "count": self.count,
            **self.views.facts(),
        }
        text = json.dumps(facts, sort_keys=True)
        digest = hashlib.sha256(text.encode()).hexdigest()
        manifest = self.output / _MANIFEST
        if _digest_in(manifest) not in (None, digest):
            raise ConfigError(
                f"{self.output} holds a data set of other settings; give another paths.output, or "
                "remove it"
            )
        content: dict[str, Any] = {"sha256": digest, "settings": facts, "versions": versions()}
        if not manifest.is_file():
            write_text(manifest, json.dumps(content, indent=1) + "\n")


def _digest_in(manifest: Path) -> str | None:
    """What `_claim` wrote, None if it did not."""
    if not manifest.is_file():
        return None
    try:
        return str(json.loads(manifest.read_text(encoding="utf-8"))["sha256"])
    except (OSError, ValueError, KeyError, TypeError):
        return "damaged"


def _write(
    views: AnnotatedScenes,
    form: DatasetFormat,
    count: int,
    job: tuple[int, Path, list[int]],
) -> None:
    """Renders and writes one scene."""
    scene, folder, numbers = job
    # Programs that read such data sets look at all files; a scene there is never replaced
    with replacing_folder(folder, listed=False) as temporary:
        form.write_scene(temporary, views.views(scene, count), numbers)
