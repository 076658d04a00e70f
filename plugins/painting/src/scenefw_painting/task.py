"""Manual labels: exports a map's picture to paint on, and makes training data from the result."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.files import require_writable
from scenefw.core.folders import require_replaceable
from scenefw.core.settings import COUNT, NOT_NEGATIVE, POSITIVE
from scenefw.data.files.height_maps import load_map, save_map
from scenefw.data.files.recordings import STATE, MeasuredFrames, Recording
from scenefw.data.files.sequences import open_sequence
from scenefw.report.console import track
from scenefw.report.labelling.pictures import map_picture
from scenefw.report.pictures import save_picture
from scenefw_painting.pictures import (
    export_painting,
    load_painting,
    require_agreement,
    write_views,
)

if TYPE_CHECKING:
    from scenefw.core.height_maps import HeightMap

_VIEWS = "views"
_CHECKED = 8  # views checked against the map, as their poses may be in another world frame


class PaintExport:
    """Writes the colour picture of a saved map, to paint labels on, with the palette beside it.

    Args:
        input: a saved map (.npz).
        classes: names of the classes to paint; None = those of the map.
        output: the run's folder.

    Raises:
        ConfigError: no input is given.
    """

    def __init__(
        self,
        input: str | Path | None,  # noqa: A002 - named as the setting on the command line
        output: str | Path,
        classes: Sequence[str] | None = None,
    ) -> None:
        if input is None:
            raise ConfigError("run=paint_export needs input=map.npz, a saved height map")
        self.input = Path(input)
        self.output = Path(output)
        self.classes = classes

    def run(self) -> dict[str, float]:
        """Returns the number of vertices to paint.

        Raises:
            InputError: the map can't be read.
            ConfigError: neither the map nor the settings name classes.
        """
        require_writable(self.output)
        height_map = load_map(self.input).height_map
        classes = tuple(self.classes or height_map.classes)
        if not classes:
            raise ConfigError(f"{self.input} names no classes; give run.classes=[surface,...]")
        print(export_painting(self.output, height_map, classes))
        return {"vertices": float(height_map.seen.sum()), "classes": float(len(classes))}


class PaintImport:
    """Reads a painted picture as the true labels of its map and labels views with them.

    Args:
        input: the painted picture; `palette.json` of the export lies beside it.
        map: the saved map that was exported.
        output: the run's folder; gets `labelled.npz`, `labelled.png` and `views/`.
        views: folder of the recording that the map was made of, or of another one with poses of the
            same world, whose views are labelled; None = none are.
        every: label every N-th view.
        border: pixels on either side of a border between labels that count as unknown.
        background: class of what was left unpainted; None = unknown.
        intrinsics: of the views, as of `run=label`.
        depth_scale: of the views, as of `run=label`.
        largest_jump: of the views, as of `run=label`.

    Raises:
        ConfigError: no picture or no map is given, or a number out of range.
    """

    def __init__(
        self,
        input: str | Path | None,  # noqa: A002 - named as the setting on the command line
        map: str | Path | None,  # noqa: A002 - named as the setting on the command line
        output: str | Path,
        views: str | Path | None = None,
        every: int = 1,
        border: int = 2,
        background: str | None = None,
        *,
        intrinsics: str | Path | None = None,
        depth_scale: float | None = None,
        largest_jump: float | None = 0.2,
    ) -> None:
        if input is None or map is None:
            raise ConfigError("run=paint_import needs input=PAINTED.png and run.map=map.npz")
        COUNT.require(every=every)
        NOT_NEGATIVE.require(border=border)
        POSITIVE.require(depth_scale=depth_scale, largest_jump=largest_jump)
        self.options: dict[str, Any] = {
            "intrinsics": intrinsics,
            "depth_scale": depth_scale,
            "largest_jump": largest_jump,
        }
        self.input = Path(input)
        self.map = Path(map)
        self.output = Path(output)
        self.views = Path(views) if views else None
        self.every, self.border, self.background = every, border, background

    def run(self) -> dict[str, float]:
        """Returns the share of each class and the number of labelled views.

        Raises:
            InputError: the picture, the map or the sequence can't be used, or nothing is painted.
        """
        require_writable(self.output)
        if self.views is not None:
            require_replaceable(self.output / _VIEWS)
        saved = load_map(self.map)
        painted = load_painting(self.input, saved.height_map, background=self.background)
        if painted.labels is None or not (painted.labels >= 0).any():
            raise InputError(
                f"nothing is painted in {self.input}; paint on it with the colours of palette.png, "
                "or give run.background=CLASS if all of it is one class"
            )
        save_map(self.output / "labelled.npz", painted)
        save_picture(map_picture(painted), self.output / "labelled.png")
        count = 0
        if self.views is not None:
            recording = Recording.from_state(saved.states.get(STATE, {}))
            count = self._label_views(self.views, painted, recording)
        labels = painted.labels if painted.labels is not None else np.zeros(0, np.int32)
        shares = {
            f"share/{name}": float(np.mean(labels == i)) for i, name in enumerate(painted.classes)
        }
        return shares | {"views": float(count)}

    def _label_views(self, folder: Path, painted: HeightMap, recording: Recording) -> int:
        """Labels the views that have a pose in the map; returns their number."""
        posed = not recording.poses_estimated
        sequence = open_sequence(folder, require_poses=posed, **self.options)
        indices = range(0, len(sequence), self.every)
        checked = MeasuredFrames(sequence, indices[:: max(1, len(indices) // _CHECKED)])
        require_agreement(painted, recording.in_map(checked), str(folder))
        frames = recording.in_map(MeasuredFrames(sequence, track(indices, "views")))
        view_folder = write_views(self.output / _VIEWS, painted, frames, self.border)
        return len(list((view_folder / "depth").iterdir()))
