"""Shows a labelled height map in the browser, while it grows or from its file."""

from __future__ import annotations

import threading
import zipfile
from typing import TYPE_CHECKING

from scenefw.core.errors import ConfigError
from scenefw.core.files import DAMAGED
from scenefw.data.files.height_maps import load_map
from scenefw_viewer.map_viewer import MapViewer
from scenefw_viewer.server import (
    announce,
    close_server,
    open_server,
    require_free,
    require_viser,
)

if TYPE_CHECKING:
    from pathlib import Path

    from scenefw.tasks.label import Label


class ViewMap:
    """Labels a recording, as `Label` does, and shows the map as it grows until Ctrl-C.

    A saved map is shown as it is. Ctrl-C while frames are still added keeps the map made so far.

    Args:
        label: makes the map and its files.
        every: frames from one shown map to the next; each costs a labelling of the map.
        host: address that browsers reach it at; 127.0.0.1 is for this machine alone.
        port: 0 takes a free one.
        seconds: ends this long after the last frame; None = with Ctrl-C.

    Raises:
        ConfigError: a number that isn't positive.
    """

    def __init__(
        self,
        label: Label,
        every: int = 5,
        host: str = "127.0.0.1",
        port: int = 8080,
        seconds: float | None = None,
    ) -> None:
        if every < 1:
            raise ConfigError(f"run.every = {every}: expected at least 1 frame")
        if seconds is not None and not seconds > 0:
            raise ConfigError(f"run.seconds = {seconds}: expected seconds above 0, or null")
        self.label, self.every = label, every
        self.host, self.port, self.seconds = host, port, seconds

    def run(self) -> dict[str, float]:
        """Serves until it ends; returns what labelling returns, of a saved map its coverage.

        Raises:
            InputError: the input is unusable.
            ConfigError: the port is in use.
            MissingDependencyError: viser is not installed.
            StorageError: the output folder can't be written.
        """
        require_viser()
        require_free(self.host, self.port)  # before the work
        saved = load_map(self.label.input) if is_map(self.label.input) else None
        figures: dict[str, float] = {}
        server = open_server(self.host, self.port)
        try:
            viewer = MapViewer(server, "waiting for the first frame")
            announce(self.host, server.get_port())
            if saved is None:
                viewer.say("frames are being added")
                figures = self.label.run(viewer, self.every)
                viewer.say(f"all frames are in; files are in {self.label.output}")
            else:
                viewer.show(saved.height_map, self.label.input.name)
                viewer.say("a saved map")
                figures = {"coverage": float(saved.height_map.seen.mean())}
            threading.Event().wait(self.seconds)
        except KeyboardInterrupt:
            pass
        finally:
            close_server(server)
        print("viewer ended")
        return figures


def is_map(path: Path | str) -> bool:
    """Whether a file has the parts of a saved map; depth images, also `.npz`, have others."""
    try:
        with zipfile.ZipFile(path) as file:
            return {"grid.npy", "heights.npy"} <= set(file.namelist())
    except DAMAGED:
        return False
