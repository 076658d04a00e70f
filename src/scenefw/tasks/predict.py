"""Predicts complete objects from real depth images."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.files import require_writable
from scenefw.core.folders import replacing_folder, require_replaceable
from scenefw.core.protocols import ObjectTracking, SceneFormat, Settling
from scenefw.core.settled import words as settled_words
from scenefw.core.types import Float32, Float64, Frame, SceneEstimate
from scenefw.data.files.camera_pose import camera_pose_of
from scenefw.data.files.pose_conventions import OPENCV
from scenefw.perception.estimate.base_frame import with_camera_in_base
from scenefw.perception.pipeline import ReconstructionPipeline
from scenefw.report.hypotheses import draw_hypotheses
from scenefw.report.overview import write_overview
from scenefw.report.page import write_scene_page
from scenefw.report.palette import colours_of
from scenefw.report.pictures import save_picture
from scenefw.report.scenes3d import Scene3D, layer, packed
from scenefw.report.solids import solids_of
from scenefw.report.window import two_views
from scenefw.tasks.depth_images import DepthImages
from scenefw.tasks.scene_files import write_scene
from scenefw.tasks.several_images import finished, require_some


class TrackerSource(Protocol):
    """Where a tracker comes from, asked only if a run tracks."""

    def __call__(self) -> Callable[..., ObjectTracking] | None:
        """What makes one of a pipeline and `hypotheses`; None: nothing does."""


class Predict:
    """Completes the objects of depth images; each image gets its own folder.

    A folder holds `scene.glb`, `object_01.ply` ..., `scene.json`, `overview.png`, and `scene.html`
    to turn all hypotheses in. What other codes make of the image is in `hypothesis_2` ... and
    `hypotheses.png`. The folder appears when all of them are written. Volumes of further
    representations are in `volumes.npz`, by name. An unusable image doesn't lose the others: it is
    reported at the end, and the command ends with status 2.

    Args:
        input: a depth image or a folder of them.
        pipeline: makes the scene of an image.
        output: where the folders go.
        intrinsics: file with the intrinsics of .png and .npy images; None looks beside them.
        depth_scale: metres per unit of integer depth; None = that of the format, else millimetres.
        overview: also draw pictures.
        page: also write `scene.html`, which needs no other file, server or network.
        settling: lets the objects come to rest first; None leaves them as predicted.
        hypotheses: also write what drawn codes give; how many, `pipeline.samples` says.
        exports: what writes further files of each scene, by name.
        masks: folder of masks of objects, NAME.png for each image, or such a file (see
            `data.files.arrays.read_mask`); None = none are known.
        camera_pose: of the camera in a robot's base, a file or numbers (see
            `data.files.camera_pose`); results are then in the base. None: in the floor's frame.
        track: the images show one scene in the order of their names: objects keep their ids, and
            `scene.json` says what each does. The camera must stand still, or the folder hold its
            poses as a recording does (`data.files.image_poses`); results are then in their world.
        poses: convention of these poses, as `pose_conventions.converted` takes it.
        tracking: with what.

    Raises:
        ConfigError: no input is given, the depth scale is not positive, or nothing tracks.
        InputError: what is given is no pose.
    """

    def __init__(
        self,
        input: str | Path | None,  # noqa: A002 - named as the setting on the command line
        pipeline: ReconstructionPipeline,
        output: str | Path = "outputs",
        intrinsics: str | Path | None = None,
        depth_scale: float | None = None,
        settling: Settling | None = None,
        *,
        overview: bool = True,
        page: bool = True,
        hypotheses: bool = True,
        exports: Mapping[str, SceneFormat] | None = None,
        masks: str | Path | None = None,
        camera_pose: str | Sequence[float] | None = None,
        track: bool = False,
        poses: str = OPENCV,
        tracking: TrackerSource | None = None,
    ) -> None:
        self.images = DepthImages("predict", input, intrinsics, depth_scale, masks, output)
        self.pipeline, self.output, self.settling = pipeline, Path(output), settling
        self.overview, self.page = overview, page
        self.hypotheses = hypotheses
        self.exports = dict(exports or {})
        self.camera_pose = camera_pose_of(camera_pose, "run.camera_pose")
        self.tracker = _maker(tracking)(pipeline, hypotheses=hypotheses) if track else None
        if poses != OPENCV and (not track or camera_pose is not None):
            raise ConfigError(
                f"run.poses={poses} is the convention of a recording's poses, which only "
                "run.track=true reads, and not beside run.camera_pose; leave it out"
            )
        self.convention = poses
        self._poses: Mapping[Path, Float64] = {}

    def run(self) -> dict[str, float]:
        """Predicts all images; returns how many, how many failed, objects and seconds per image.

        Raises:
            InputError: there is no image, or none is usable.
            IncompleteError: some are unusable.
            StorageError: the output folder can't be written.
        """
        objects = 0
        start = time.perf_counter()
        if self.tracker is not None and self.camera_pose is None:
            self._poses = self.images.poses(self.convention)

        def predict(image: Path, folder: Path) -> None:
            nonlocal objects
            objects += len(self.predict(image, folder).objects)

        count, failures = self.for_each(predict)
        figures = {
            "objects_per_image": objects / (count - len(failures)),
            "seconds_per_image": (time.perf_counter() - start) / count,
        }
        return finished(figures, failures, count)

    def for_each(self, work: Callable[[Path, Path], object]) -> tuple[int, dict[Path, InputError]]:
        """Does something with each image and its folder; returns how many, and which failed.

        Raises:
            InputError: there is no image, or none is usable.
            StorageError: the output folder can't be written.
        """
        images = self.images.find()
        require_writable(self.output)
        folders = [self.output / folder for folder in self._folders(images)]
        for folder in folders:
            require_replaceable(folder)
        failures: dict[Path, InputError] = {}
        steps: Iterable[tuple[Path, Path]] = list(zip(images, folders, strict=True))
        if len(images) > 1:
            from rich.progress import track

            steps = track(steps, "images")
        for image, folder in steps:
            try:
                work(image, folder)
            except InputError as error:
                failures[image] = error
        require_some(failures, len(images))
        return len(images), failures

    def predict(self, image: Path, folder: Path) -> SceneEstimate:
        """Predicts one image and writes its folder, which appears whole or not at all.

        Raises:
            InputError: the image is unusable.
            StorageError: the folder can't be written.
        """
        frame, mask = self.images.read(image)
        scenes, partial = self._scenes(frame, mask, self._poses.get(image, self.camera_pose))
        estimate, *alternatives = self._at_rest(scenes)
        with replacing_folder(folder) as temporary:
            colours = write_scene(temporary, estimate, self.exports, alternatives)
            layers = [layer("most typical", estimate, colours)]
            for number, alternative in enumerate(alternatives, start=2):
                beside = temporary / f"hypothesis_{number}"
                beside.mkdir()
                alternative_colours = write_scene(beside, alternative, self.exports)
                layers.append(layer(f"hypothesis {number}", alternative, alternative_colours))
            if self.page:
                scene = Scene3D(frame.name, tuple(layers), estimate.frame, estimate.obstacles)
                write_scene_page(temporary / "scene.html", frame.name or "scene", packed([scene]))
            if self.overview:
                self._draw(temporary, frame, partial, [estimate, *alternatives])
        return estimate

    def _draw(
        self, folder: Path, frame: Frame, partial: Float32, scenes: Sequence[SceneEstimate]
    ) -> None:
        """Pictures of the most typical scene, and of all of them side by side if there are more."""
        solids, first = solids_of(scenes), scenes[0]
        views = two_views(solids[0], first)
        write_overview(folder / "overview.png", first, partial, colours_of(first), views, frame)
        if len(scenes) > 1:
            picture = draw_hypotheses(scenes, solids, views)
            save_picture(picture, folder / "hypotheses.png", fast=True)

    def _scenes(
        self, frame: Frame, mask: Any, camera_pose: Float64 | None
    ) -> tuple[list[SceneEstimate], Float32]:
        """All hypotheses, or the most typical one, and the partial TSDF (X, Y, Z; m)."""
        warnings: Sequence[str]
        if self.tracker is None:
            view = self.pipeline.observe(frame, mask)
            warnings, partial = view.warnings, view.partial.distance[0, 0].cpu().numpy()
        else:
            tracked = self.tracker.track(frame, mask, camera_pose)
            warnings, partial = tracked.warnings, tracked.partial
        for warning in warnings:
            print(f"{frame.name}: {warning}", file=sys.stderr)
        if self.tracker is None:
            scenes = self.pipeline.reconstruct(view, first_only=not self.hypotheses)
        else:
            scenes = list(tracked.scenes)
        scenes = [with_camera_in_base(scene, camera_pose) for scene in scenes]
        for warning in scenes[0].details.get("warnings", ())[len(warnings) :]:
            print(f"{frame.name}: {warning}", file=sys.stderr)
        return scenes, partial

    def _at_rest(self, scenes: list[SceneEstimate]) -> list[SceneEstimate]:
        """The hypotheses, at rest if they settle."""
        if self.settling is None:
            return scenes
        settled = self.settling.settle(scenes)
        print(f"{scenes[0].frame.name}: {settled_words(settled[0])}")
        return settled

    def _folders(self, images: Sequence[Path]) -> list[Path]:
        """A folder for each image in the output: its path below the input, without suffix."""
        names = [self.images.name(image).with_suffix("") for image in images]
        # A folder is replaced as a whole, so none may be inside another image's
        shared = Counter([*names, *{parent for name in names for parent in name.parents}])
        return [
            name.with_name(image.name.replace(".", "_")) if shared[name] > 1 else name
            for name, image in zip(names, images, strict=True)
        ]


def _maker(tracking: TrackerSource | None) -> Callable[..., ObjectTracking]:
    """What makes a tracker of a pipeline.

    Raises:
        ConfigError: there is none.
    """
    maker = None if tracking is None else tracking()
    if maker is None:
        raise ConfigError(
            "run.track=true needs tracking=objects of the plugin tracking, which is missing or "
            "left out; install scenefw with its plugins, or leave out run.track"
        )
    return maker
