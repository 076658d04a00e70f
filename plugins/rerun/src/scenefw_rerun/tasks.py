"""Predictions and labelled sequences as recordings for Rerun."""

from __future__ import annotations

from pathlib import Path

from scenefw.core.errors import InputError
from scenefw.core.files import require_writable
from scenefw.core.settings import COUNT
from scenefw.tasks.label import Label
from scenefw.tasks.several_images import finished, require_some
from scenefw_rerun.recording import MapRecorder, log_prediction, recording, require_rerun
from scenefw_viewer.view import View


class RecordPrediction:
    """Predicts images and writes `NAME.rrd` of each, with all hypotheses (`run=rerun`).

    Args:
        view: reads and predicts images, and says where the output goes.
    """

    def __init__(self, view: View) -> None:
        self.view = view

    def run(self) -> dict[str, float]:
        """Records all images; returns how many, and how many failed.

        Raises:
            InputError: there is no image, or none is usable.
            IncompleteError: some are unusable.
            MissingDependencyError: rerun-sdk is not installed.
            StorageError: the output folder can't be written.
        """
        require_rerun()
        images = self.view.images.find()
        require_writable(self.view.output)
        failures: dict[Path, InputError] = {}
        for image in images:
            try:
                self.record(image)
            except InputError as error:
                failures[image] = error
        require_some(failures, len(images))
        return finished({}, failures, len(images))

    def record(self, image: Path) -> Path:
        """Predicts one image and writes its recording; returns the path.

        Raises:
            InputError: the image is unusable.
            StorageError: the file can't be written.
        """
        scenes = self.view.predict(image).scenes
        path = self.view.output / self.view.images.name(image).with_suffix(".rrd")
        with recording(path) as stream:
            log_prediction(stream, scenes, scenes[0].frame)
        print(path)
        return path


class RecordMap:
    """Labels a recording, as `run=label`, and writes how the map grew: `map.rrd` (`run=rerun_map`).

    Args:
        label: makes the map and its files.
        every: frames from one recorded map to the next.

    Raises:
        SettingError: `every` is below 1.
    """

    def __init__(self, label: Label, every: int = 5) -> None:
        COUNT.require(every=every)
        self.label, self.every = label, every

    def run(self) -> dict[str, float]:
        """Labels and records; returns what labelling returns.

        Raises:
            InputError: the input is unusable.
            MissingDependencyError: rerun-sdk is not installed.
            StorageError: the output folder can't be written.
        """
        require_rerun()
        path = self.label.output / "map.rrd"
        with recording(path) as stream:
            figures = self.label.run(MapRecorder(stream), self.every)
        print(path)
        return figures
