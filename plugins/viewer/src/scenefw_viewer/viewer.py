"""A viewer in the browser: hypotheses of an image, what was seen, edits and exports (viser)."""

from __future__ import annotations

import io
import sys
import threading
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenefw.core.errors import ConfigError, SceneFWError
from scenefw.perception.estimate.base_frame import in_base
from scenefw.perception.physics.support_graph import support_graph
from scenefw.perception.ranking.next_view import next_views, views_around
from scenefw.report.palette import instance_colours
from scenefw_viewer import layers
from scenefw_viewer.edits import Edits
from scenefw_viewer.object_table import object_table
from scenefw_viewer.stage import Stage

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from scenefw.core.protocols import SceneFormat, Settling
    from scenefw.core.types import Float64, SceneEstimate
    from scenefw.perception.physics.support_graph import SupportGraph
    from scenefw.report.palette import Colour
    from scenefw_viewer.layers import Prediction

_NOTHING = "none"
_VIEW_ANGLE = 0.7  # rad
_SHOWN = {  # layer: words, visible at first
    "points": ("point cloud", True),
    "objects": ("objects", True),
    "captions": ("captions", True),
    "superquadrics": ("superquadrics", False),
    "obstacles": ("obstacles", True),
    "truth": ("truth", False),
    "floor": ("floor grid", True),
    "camera": ("camera", False),
    "slice": ("slice of what was seen", False),
}


class Viewer:
    """Shows predictions on a server; all state is here, so a browser may come and go.

    Args:
        server: as `viewer_server.open_server` gives it.
        names: of the images.
        load: the prediction of an image by its number; called once for each that is looked at.
        formats: of exports, by the name that is shown.
        output: folder of exports, each image's in its own.
        settling: lets objects come to rest; None leaves that out.
    """

    def __init__(
        self,
        server: Any,
        names: Sequence[str],
        load: Callable[[int], Prediction],
        formats: Mapping[str, SceneFormat],
        output: Path,
        settling: Settling | None = None,
    ) -> None:
        self.server, self.names, self._load = server, list(names), load
        self.formats, self.output, self.settling = dict(formats), output, settling
        self.prediction: Prediction
        self.image, self.hypothesis = 0, 0
        self.selected: int | None = None
        self._supports: SupportGraph
        self._lock = threading.RLock()
        self._loaded: dict[int, tuple[Prediction, list[Edits]]] = {}
        self._scenes: list[Edits] = []
        self.stage = Stage(server.scene, self.select, self.place)
        self.controls: dict[str, Any] = {}
        server.scene.configure_default_lights(cast_shadow=True)
        _, self._scenes = self._prediction(0)
        self._add_controls()
        self._show_image(0)

    @property
    def edits(self) -> Edits:
        """The hypothesis that is shown, and what was done to it."""
        return self._scenes[self.hypothesis]

    # What people do, each also a control of the panel

    def choose_image(self, number: int) -> None:
        """Shows another image; the first time this predicts it.

        Raises:
            InputError: it is unusable; the one before stays.
        """
        with self._lock:
            if number != self.image:
                self._prediction(number)
                self._show_image(number)

    def choose(self, hypothesis: int) -> None:
        """Shows another hypothesis, counted from 0, with what was done to it."""
        with self._lock:
            self.hypothesis = min(hypothesis, len(self._scenes) - 1)
            self._show_scene()

    def toggle(self, layer: str, visible: bool) -> None:
        """Shows or hides a layer of `stage.LAYERS`."""
        self.stage.toggle(layer, visible)

    def slice(self, axis: str, place: float) -> None:
        """Shows the partial TSDF across an axis at a place (m)."""
        grid = self.edits.scene.grid
        self.stage.show_slice(
            layers.slice_volume(self.prediction.partial, grid, "xyz".index(axis), place)
        )

    def select(self, label: int | None) -> None:
        """Says which object the buttons are for."""
        with self._lock:
            self.selected = label
            self._show_selection()

    def remove(self) -> None:
        """Takes the selected object away, or puts it back if it is away."""
        with self._lock:
            label = self.selected
            if label is None:
                return
            is_removed = label in self.edits.removed
            (self.edits.put_back if is_removed else self.edits.remove)(label)
            self.stage.update(label, self.edits)
            self._show_selection()

    def place(self, label: int, pose: Float64) -> None:
        """Moves an object until it has this 4x4 pose in world coordinates."""
        with self._lock:
            self.edits.place(label, pose)
            self.stage.update(label, self.edits)

    def undo(self) -> None:
        """Brings all objects of this hypothesis back to where they were predicted."""
        with self._lock:
            self.edits.undo()
            self._show_scene()

    def settle(self) -> SceneEstimate:
        """Lets the objects of this hypothesis come to rest; it then counts as predicted so.

        Raises:
            SceneFWError: the simulator is missing.
        """
        if self.settling is None:
            raise ConfigError("nothing settles here; give settling=physics")
        with self._lock:
            removed_labels = set(self.edits.removed)
            settled = self.settling.settle([self.edits.result()])[0]
            at_rest = {item.id: item.pose.matrix for item in settled.objects}
            for label in set(at_rest) - removed_labels:
                self.edits.place(label, at_rest[label])
            self._show_scene()
            return settled

    def export(self, name: str) -> tuple[Path, ...]:
        """Writes the scene as it is shown; returns the file and what it refers to.

        Raises:
            StorageError: the folder can't be written.
        """
        with self._lock:
            form, scene = self.formats[name], self.edits.result()
            folder = self.output / self.names[self.image]
            if self.hypothesis:
                folder /= f"hypothesis_{self.hypothesis + 1}"
            folder.mkdir(parents=True, exist_ok=True)
            path = folder / f"scene{form.suffix}"
            form.write(path, in_base(scene), [_colour(item.id) for item in scene.objects])
        print(path)
        below = folder / f"scene_{form.suffix.lstrip('.')}"
        parts = sorted(p for p in below.rglob("[!.]*") if p.is_file()) if below.is_dir() else []
        return (path, *parts)

    # What is shown

    def _prediction(self, number: int) -> tuple[Prediction, list[Edits]]:
        if number not in self._loaded:
            prediction = self._load(number)
            self._loaded[number] = prediction, [Edits(scene) for scene in prediction.scenes]
        return self._loaded[number]

    def _show_image(self, number: int) -> None:
        self.prediction, self._scenes = self._prediction(number)
        self.image, self.hypothesis = number, 0
        with self.server.atomic():
            self.stage.show_image(self.prediction)
            self._fit_controls()
            self._show_scene()
            self.look()

    def _show_scene(self) -> None:
        labels = self.edits.ids
        self._supports = support_graph(self.edits.scene.objects)
        with self.server.atomic():
            self.stage.show_objects(self.edits)
            options = [_NOTHING, *map(_option, labels)]
            self.controls["object"].options = options
            self.controls["about"].content = object_table(
                self.edits, self._supports, self._warnings
            )
        self.select(self.selected if self.selected in labels else None)

    @property
    def _warnings(self) -> Sequence[str]:
        return self.prediction.scenes[0].details.get("warnings", ())

    def _show_selection(self) -> None:
        label, none = self.selected, self.selected is None
        self.controls["object"].value = _NOTHING if label is None else _option(label)
        button = self.controls["remove"]
        button.disabled = none
        button.label = "Put back" if label in self.edits.removed else "Remove"
        self.stage.hold(label, self.edits)
        self.controls["about"].content = object_table(self.edits, self._supports, self._warnings)

    def look(self, client: Any = None, whence: str = "start") -> None:
        """Turns browsers to the scene: from the start's place, the camera, above, or next view.

        The next view is the one that would tell the hypotheses apart best.
        """
        eye, middle = layers.start(self.prediction.scenes[0])
        if whence == "camera":
            eye = self.prediction.scenes[0].frame.camera.T_world_camera[:3, 3]
        elif whence == "next view":
            scenes = self.prediction.scenes
            view = next_views(scenes, views_around(scenes[0]))[0]
            eye = view.T_world_camera[:3, 3]
            print(f"next view: {view.score:.0%} of what is uncertain would be seen")
            if client is not None:
                client.add_notification(
                    "Next view", f"{view.score:.0%} of what is uncertain would be seen from here"
                )
        elif whence == "above":
            eye = middle + [0.0, -1e-3, float(((eye - middle) ** 2).sum() ** 0.5)]
        first = self.server.initial_camera
        if whence == "start":
            first.position, first.look_at, first.fov = eye, middle, _VIEW_ANGLE
        clients = self.server.get_clients().values() if client is None else [client]
        for browser in clients:
            browser.camera.position, browser.camera.look_at = eye, middle

    # The panel

    def _add_controls(self) -> None:
        gui, controls = self.server.gui, self.controls
        if len(self.names) > 1:
            controls["image"] = gui.add_dropdown("image", self.names)
            controls["image"].on_update(self._guarded(self._change_image, "predicting ..."))
        controls["hypothesis"] = gui.add_slider("hypothesis", 1, 2, 1, 1)
        controls["hypothesis"].on_update(
            lambda _: self.choose(int(controls["hypothesis"].value) - 1)
        )
        controls["from"] = gui.add_button_group(
            "look from", ["start", "camera", "above", "next view"]
        )
        controls["from"].on_click(lambda event: self.look(event.client, event.target.value))
        tabs = gui.add_tab_group()
        with tabs.add_tab("Objects"):
            controls["about"] = gui.add_html("")
            self._add_edits()
            self._add_exports()
        with tabs.add_tab("Show"):
            self._add_toggles()

    def _add_edits(self) -> None:
        gui, controls = self.server.gui, self.controls
        with gui.add_folder("Change"):
            controls["object"] = gui.add_dropdown(
                "object", [_NOTHING], hint="or click one; arrows and rings move it"
            )
            controls["remove"] = gui.add_button("Remove", disabled=True)
            controls["undo"] = gui.add_button("Undo all changes")
            if self.settling is not None:
                controls["settle"] = gui.add_button(
                    "Settle", hint="objects come to rest (simulation)"
                )
                controls["settle"].on_click(self._guarded(lambda _: self.settle(), "settling ..."))
        controls["object"].on_update(lambda _: self._choose_object(controls["object"].value))
        controls["remove"].on_click(lambda _: self.remove())
        controls["undo"].on_click(lambda _: self.undo())

    def _add_exports(self) -> None:
        gui, controls = self.server.gui, self.controls
        with gui.add_folder("Export"):
            controls["format"] = gui.add_dropdown("format", list(self.formats))
            controls["export"] = gui.add_button("Export")
        controls["export"].on_click(self._guarded(self._export, "writing ..."))

    def _add_toggles(self) -> None:
        gui, controls = self.server.gui, self.controls
        for layer, (words, visible) in _SHOWN.items():
            controls[layer] = gui.add_checkbox(words, visible)
            controls[layer].on_update(
                lambda event, layer=layer: self.toggle(layer, event.target.value)
            )
            self.toggle(layer, visible)
        controls["axis"] = gui.add_button_group("slice across", ["x", "y", "z"])
        controls["place"] = gui.add_slider("at (m)", -0.5, 0.5, 0.01, 0.0)
        self._axis = "y"
        controls["axis"].on_click(lambda event: self._change_slice(event.target.value))
        controls["place"].on_update(lambda _: self._change_slice(self._axis))

    def _fit_controls(self) -> None:
        """The panel offers what this image has."""
        controls, count = self.controls, len(self._scenes)
        controls["hypothesis"].visible = count > 1
        controls["hypothesis"].max = max(count, 2)
        controls["hypothesis"].value = 1
        fitted = any(item.placed for edits in self._scenes for item in edits.scene.objects)
        controls["superquadrics"].visible = fitted
        controls["truth"].visible = layers.truth(self.prediction) is not None
        self._change_slice(self._axis)

    def _change_slice(self, axis: str) -> None:
        grid, place = self.edits.scene.grid, self.controls["place"]
        low = grid.lower["xyz".index(axis)]
        place.min, place.max = round(low, 2), round(low + grid.extent, 2)
        self._axis = axis
        self.slice(axis, float(place.value))

    def _choose_object(self, option: str) -> None:
        label = None if option == _NOTHING else int(option.rsplit(" ", 1)[-1])
        if label != self.selected:
            self.select(label)

    def _change_image(self, _: Any) -> None:
        try:
            self.choose_image(self.names.index(self.controls["image"].value))
        finally:
            self.controls["image"].value = self.names[self.image]

    def _export(self, event: Any) -> None:
        files = self.export(self.controls["format"].value)
        name = f"{Path(self.names[self.image]).name}_{files[0].name}"
        content = files[0].read_bytes()
        if len(files) > 1:
            name, content = f"{name}.zip", _zipped(files)
        if event.client is not None:
            event.client.send_file_download(name, content, save_immediately=True)
            event.client.add_notification("Written", str(files[0]), auto_close_seconds=8)

    def _guarded(self, act: Callable[[Any], object], words: str) -> Callable[[Any], None]:
        """A callback that says what it waits for, and shows errors in a line."""

        def callback(event: Any) -> None:
            client = event.client
            note = client and client.add_notification("scenefw", words, loading=True)
            try:
                act(event)
            except SceneFWError as error:
                print(f"error: {error}", file=sys.stderr)
                if client is not None:
                    client.add_notification("This did not work", str(error), color="red")
            finally:
                if note is not None:
                    note.remove()

        return callback


def _option(label: int) -> str:
    return f"object {label}"


def _colour(label: int) -> Colour:
    return instance_colours(label)[-1]


def _zipped(files: Sequence[Path]) -> bytes:
    """The files under their names relative to the first one's folder."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in files:
            archive.write(path, path.relative_to(files[0].parent))
    return packed.getvalue()
