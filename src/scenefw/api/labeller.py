"""Labels a table-top from RGB-D frames that are added one by one."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from scenefw.core.errors import ConfigError, InputError, require_number
from scenefw.data.files.arrays import frame_of
from scenefw.data.files.height_maps import save_map
from scenefw.data.files.recordings import STATE, Recording

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

    from scenefw.api.settings import Settings
    from scenefw.core.height_maps import HeightMap
    from scenefw.core.labelling_protocols import Labelling, RunningLabelling
    from scenefw.core.types import Frame
    from scenefw.data.files.intrinsics import Intrinsics
    from scenefw.perception.observation.table_frame import TableFrame


class Labeller:
    """What `scenefw.load("labelling")` gives: a map that grows frame by frame.

    Args:
        strategies: by name; one of them.
        table: finds the table in the first frame.
        computing: threads compute within what it returns.

    Raises:
        ConfigError: not one strategy.
    """

    def __init__(
        self,
        strategies: Mapping[str, Labelling],
        table: TableFrame,
        computing: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> None:
        if len(strategies) != 1:
            raise ConfigError(
                f"labelling takes one strategy, got {', '.join(strategies) or 'none'}; give "
                'labelling="hybrid" (or view_based, map_based)'
            )
        self.strategy = next(iter(strategies.values()))
        self.table = table
        self._computing = computing
        self.restart()

    @classmethod
    def built(cls, settings: Settings) -> Labeller:
        """The labeller of `run=label` with these settings."""
        strategies, table = settings.build("run.strategies", "run.table")
        return cls(strategies, table, settings.computing)

    @property
    def classes(self) -> tuple[str, ...]:
        """Names by class id."""
        return tuple(self.strategy.classes)

    def __len__(self) -> int:
        """Number of frames in the map."""
        return self._number

    def restart(self) -> None:
        """Forgets all frames and begins a new map."""
        self._number, self._posed = 0, False
        self._recording = Recording(None)
        self._running: RunningLabelling = self.strategy.begin()

    def add(
        self,
        depth: ArrayLike,
        intrinsics: Intrinsics,
        color: ArrayLike | None = None,
        pose: ArrayLike | None = None,
        *,
        depth_scale: float | None = None,
        name: str | None = None,
    ) -> None:
        """Adds the next frame; the first one says where the table is.

        Args:
            depth: (H, W) z-depth: floats are metres, integers are multiplied by `depth_scale`.
            intrinsics: as of `Predictor.predict`.
            color: (H, W, 3) uint8, aligned with the depth; networks need it.
            pose: (4, 4) camera (OpenCV) to any world; may be None if there is one frame alone.
            depth_scale: metres per unit of integer depth; None = 0.001. An error with floats.
            name: of the frame; None = its number.

        Raises:
            InputError: the frame is unusable, or a second one has no pose.
        """
        require_number(depth_scale, "depth_scale", "metres per unit of integer depth, or None")
        name = f"{self._number:06d}" if name is None else name
        if self._number and (pose is None or not self._posed):
            raise InputError(
                f"frame {name} needs poses: give pose=(4, 4), camera to world, of every frame, or "
                "restart() for a map of its own"
            )
        frame = frame_of(depth, intrinsics, color, pose=pose, depth_scale=depth_scale, name=name)
        with self._computing():
            placed, recording = self._placed(frame, posed=pose is not None)
            self._running.add(placed)
        self._posed, self._number = pose is not None, self._number + 1
        self._recording = recording.extended(placed)

    def height_map(self) -> HeightMap:
        """The map of all frames so far: `heights`, `labels`, `probabilities`, `classes`, `colour`.

        Raises:
            InputError: no frame was added.
        """
        if not self._number:
            raise InputError("the map has no frame yet; add(depth, intrinsics, color, pose) first")
        with self._computing():
            return self._running.height_map()

    def save(self, path: str | Path) -> Path:
        """Writes the map: `.npz`, which `run=label run.resume=FILE` continues, or a picture `.png`.

        Raises:
            InputError: another suffix, or no frame was added.
            StorageError: the file can't be written.
        """
        path = Path(path).expanduser()
        if path.suffix.lower() == ".npz":
            states = {**self._running.states(), STATE: self._recording.state()}
            return save_map(path, self.height_map(), states)
        if path.suffix.lower() == ".png":
            from scenefw.report.labelling.pictures import map_picture
            from scenefw.report.pictures import save_picture

            save_picture(map_picture(self.height_map()), path)
            return path
        raise InputError(f"no format writes '{path.suffix}' of {path}; give one of .npz, .png")

    def _placed(self, frame: Frame, *, posed: bool) -> tuple[Frame, Recording]:
        """The frame in map coordinates, and the recording before it."""
        before = self._recording
        if not self._number:
            T = self.table.alignment(frame, posed=posed).T_table_world  # noqa: N806
            if not posed:
                pose = T @ frame.camera.T_world_camera
                return replace(frame, camera=frame.camera.moved(pose)), before
            before = Recording(T)
        return next(iter(before.in_map([frame]))), before
