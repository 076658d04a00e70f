"""Shows predictions of depth images in the browser."""

from __future__ import annotations

import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING

from scenefw.core.errors import ConfigError
from scenefw.core.files import require_writable
from scenefw.data.files.camera_pose import camera_pose_of
from scenefw.export.scene_files import GLB, Summary
from scenefw.perception.estimate.base_frame import with_camera_in_base
from scenefw.tasks.depth_images import DepthImages
from scenefw_viewer.layers import Prediction
from scenefw_viewer.server import (
    announce,
    close_server,
    open_server,
    require_free,
    require_viser,
)
from scenefw_viewer.viewer import Viewer

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from scenefw.core.protocols import SceneFormat, Settling
    from scenefw.perception.pipeline import ReconstructionPipeline


class View:
    """Predicts images and shows them in the browser until Ctrl-C.

    Images of a folder are predicted when they are looked at. Exports go to a folder of each image
    in the output folder, and to the browser.

    Args:
        input: a depth image or a folder of them.
        pipeline: makes the scenes of an image; `pipeline.samples` says how many.
        output: where exports go.
        intrinsics: as of `run=predict`.
        depth_scale: as of `run=predict`.
        masks: as of `run=predict`.
        settling: of the button; None leaves it out.
        exports: further formats, by name; GLB and JSON are always there.
        host: address that browsers reach it at; 127.0.0.1 is for this machine alone.
        port: 0 takes a free one.
        seconds: ends after this time; None = with Ctrl-C.
        camera_pose: as of `run=predict`; exports are then in the robot's base.

    Raises:
        ConfigError: no input is given, or a number that isn't positive.
    """

    def __init__(
        self,
        input: str | Path | None,  # noqa: A002 - named as the setting on the command line
        pipeline: ReconstructionPipeline,
        output: str | Path = "outputs",
        intrinsics: str | Path | None = None,
        depth_scale: float | None = None,
        masks: str | Path | None = None,
        settling: Settling | None = None,
        exports: Mapping[str, SceneFormat] | None = None,
        host: str = "127.0.0.1",
        port: int = 8080,
        seconds: float | None = None,
        camera_pose: str | Sequence[float] | None = None,
    ) -> None:
        self.images = DepthImages("view", input, intrinsics, depth_scale, masks, output)
        if seconds is not None and not seconds > 0:
            raise ConfigError(f"run.seconds = {seconds}: expected seconds above 0, or null")
        self.output, self.pipeline, self.settling = Path(output), pipeline, settling
        self.formats: dict[str, SceneFormat] = {"glb": GLB(), "json": Summary(), **(exports or {})}
        self.host, self.port, self.seconds = host, port, seconds
        self.camera_pose = camera_pose_of(camera_pose, "run.camera_pose")

    def run(self) -> dict[str, float]:
        """Serves until it ends; returns how many images there are.

        Raises:
            InputError: there is no image, or the first one is unusable.
            ConfigError: the port is in use.
            MissingDependencyError: viser is not installed.
            StorageError: the output folder can't be written.
        """
        require_viser()
        require_free(self.host, self.port)  # before the work
        images = self.images.find()
        require_writable(self.output)
        names = [str(self.images.name(image).with_suffix("")) for image in images]
        first = self.predict(images[0])

        def load(number: int) -> Prediction:
            return self.predict(images[number]) if number else first

        server = open_server(self.host, self.port)
        try:
            Viewer(server, names, load, self.formats, self.output, self.settling)
            announce(self.host, server.get_port())
            threading.Event().wait(self.seconds)
        except KeyboardInterrupt:
            pass
        finally:
            close_server(server)
        print(f"viewer ended; exports are in {self.output}")
        return {"images": float(len(images))}

    def predict(self, image: Path) -> Prediction:
        """What an image shows: all hypotheses.

        Raises:
            InputError: it is unusable.
        """
        frame, mask = self.images.read(image)
        view = self.pipeline.observe(frame, mask)
        for warning in view.warnings:
            print(f"{frame.name}: {warning}", file=sys.stderr)
        partial = view.partial.distance[0, 0].cpu().numpy()
        scenes = [
            with_camera_in_base(scene, self.camera_pose)
            for scene in self.pipeline.reconstruct(view)
        ]
        return Prediction(tuple(scenes), frame, partial)
