"""A labelled height map in the browser, as it grows frame by frame (viser)."""

from __future__ import annotations

import html
import threading
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.core.types import Pose
from scenefw.report.palette import class_colours
from scenefw_viewer.map_surface import looks, reduced, surface

if TYPE_CHECKING:
    from scenefw.core.height_maps import HeightMap
    from scenefw.core.types import Frame

_MOST = 64  # maps that are kept; of longer recordings every second one goes
_FRUSTUM = 0.08
_VIEW_ANGLE = 0.7  # rad
_ASIDE = np.array([0.0, -1.1, 1.15])  # of the eye from the middle of the map, in extents


@dataclass(frozen=True)
class _Shot:
    title: str
    height_map: HeightMap
    frame: Frame | None


class MapViewer:
    """Shows maps on a server, the latest one until somebody goes back; all state is here.

    Args:
        server: as `viewer_server.open_server` gives it.
        status: what is going on, one line.
    """

    def __init__(self, server: Any, status: str = "") -> None:
        self.server, self._status = server, status
        self.shots: list[_Shot] = []
        self.number = 0
        self.look = "labels"
        self._map_count, self._stride, self._passing = 0, 1, False
        self._lock = threading.RLock()
        self._moving = False  # the slider by us, not by somebody
        self.controls: dict[str, Any] = {}
        server.scene.add_frame("/camera", show_axes=False)
        self._light()
        self._add_controls()
        self._tell()

    def _light(self) -> None:
        """Such that colours of classes look as in the list."""
        scene = self.server.scene
        scene.configure_default_lights(enabled=False)
        scene.configure_environment_map(None)
        scene.add_light_ambient("/light/all", intensity=1.0)
        scene.add_light_directional("/light/above", intensity=1.8, position=(-1.0, -1.0, 2.0))

    def show(self, height_map: HeightMap, title: str, frame: Frame | None = None) -> None:
        """Adds a map; it is shown unless somebody looks at an earlier one.

        Args:
            height_map: the map.
            title: of which frames it is, in few words.
            frame: the latest one, whose camera is in the coordinates of the map.
        """
        with self._lock:
            first, following = not self.shots, self.controls["follow"].value
            self._keep(_Shot(title, reduced(height_map), frame))
            slider = self.controls["map"]
            slider.max, slider.visible = max(len(self.shots), 2), len(self.shots) > 1
            if first:
                self._offer(height_map)
                self._stand(height_map)
            if first or following:
                self.choose(len(self.shots) - 1)
            self._tell()

    def say(self, status: str) -> None:
        """Changes the line that says what is going on."""
        with self._lock:
            self._status = status
            self._tell()

    # What people do, each also a control of the panel

    def choose(self, number: int) -> None:
        """Shows one of the maps, counted from 0."""
        with self._lock:
            self.number = min(max(number, 0), len(self.shots) - 1)
            self._moving = True
            self.controls["map"].value = self.number + 1
            self._moving = False
            self._draw()

    def paint(self, look: str) -> None:
        """Shows another value of the vertices, one of `map_surface.looks`."""
        with self._lock:
            self.look = look
            self._draw()

    def export(self) -> bytes:
        """The shown surface as a GLB file."""
        with self._lock:
            return bytes(surface(self.shots[self.number].height_map, self.look).export(None, "glb"))

    def _keep(self, shot: _Shot) -> None:
        """Every n-th map stays, and the latest one."""
        if self._passing:
            self.shots.pop()
        if len(self.shots) >= _MOST:
            self.shots = self.shots[::2]
            self._stride, self.number = 2 * self._stride, self.number // 2
        self._passing = self._map_count % self._stride != 0
        self._map_count += 1
        self.shots.append(shot)

    def _draw(self) -> None:
        if not self.shots:
            return
        shot = self.shots[self.number]
        mesh = surface(shot.height_map, self.look)
        with self.server.atomic():
            if len(mesh.faces):
                self.server.scene.add_mesh_trimesh("/map", mesh, cast_shadow=False)
            self._draw_camera(shot.frame)
        self._tell()

    def _draw_camera(self, frame: Frame | None) -> None:
        if frame is None:
            return
        camera = frame.camera
        pose = Pose.from_matrix(camera.T_world_camera)
        step = max(1, camera.width // 320)
        self.server.scene.add_camera_frustum(
            "/camera/image", 2 * float(np.arctan(camera.height / 2 / camera.fy)),
            camera.width / camera.height, scale=_FRUSTUM, thickness=0.002, color=(90, 98, 110),
            image=None if frame.colour is None else frame.colour[::step, ::step],
            wxyz=pose.quaternion, position=pose.position,
        )  # fmt: skip

    def _stand(self, height_map: HeightMap) -> None:
        grid = height_map.grid
        middle = np.append(np.asarray(grid.lower) + grid.extent / 2, 0.0)
        first = self.server.initial_camera
        first.position, first.look_at = middle + grid.extent * _ASIDE, middle
        first.fov = _VIEW_ANGLE
        for client in self.server.get_clients().values():
            client.camera.position, client.camera.look_at = first.position, middle

    def _tell(self) -> None:
        self.controls["about"].content = _about(
            self.shots[self.number] if self.shots else None, self._status
        )

    # The panel

    def _add_controls(self) -> None:
        gui, controls = self.server.gui, self.controls
        controls["about"] = gui.add_html("")
        controls["map"] = gui.add_slider("map", 1, 2, 1, 1, visible=False)
        controls["map"].on_update(lambda _: self._slide())
        controls["follow"] = gui.add_checkbox("follow", True, hint="show each new map")
        controls["look"] = gui.add_button_group("show", ["labels", "colour"])
        controls["look"].on_click(lambda event: self.paint(event.target.value))
        controls["camera"] = gui.add_checkbox("camera", True)
        controls["camera"].on_update(lambda event: self._show_camera(event.target.value))
        controls["export"] = gui.add_button("Save as GLB")
        controls["export"].on_click(self._export)

    def _offer(self, height_map: HeightMap) -> None:
        """The buttons for what this map has."""
        options = looks(height_map)
        self.look = options[0]
        self.controls["look"].options = options

    def _slide(self) -> None:
        if self._moving or not self.shots:
            return
        number = int(self.controls["map"].value) - 1
        self.controls["follow"].value = number >= len(self.shots) - 1
        self.choose(number)

    def _show_camera(self, visible: bool) -> None:
        self.server.scene.add_frame("/camera", show_axes=False, visible=visible)

    def _export(self, event: Any) -> None:
        if event.client is not None and self.shots:
            event.client.send_file_download("map.glb", self.export(), save_immediately=True)


def _about(shot: _Shot | None, status: str) -> str:
    """Title, share of the table that was seen, and a line per class."""
    style = "font-size:0.85em;padding:0 0.8em;line-height:1.45"
    if shot is None:
        return f"<div style='{style}'>{html.escape(status)}</div>"
    height_map, observed = shot.height_map, shot.height_map.seen
    rows = []
    if height_map.labels is not None and observed.any():
        shares = np.bincount(
            np.maximum(height_map.labels[observed] + 1, 0), minlength=len(height_map.classes) + 1
        )
        shares = shares[1:] / observed.sum()
        for name, colour, share in zip(
            height_map.classes, class_colours(len(height_map.classes)), shares, strict=True
        ):
            red, green, blue = (round(255 * part) for part in colour)
            faint = "" if share else ";opacity:0.45"
            rows.append(
                f"<tr style='{faint}'><td style='color:rgb({red},{green},{blue})'>&#9632;</td>"
                f"<td>{html.escape(name)}</td><td style='text-align:right'>{share:.1%}</td></tr>"
            )
    return (
        f"<div style='{style}'><b>{html.escape(shot.title)}</b>, {observed.mean():.0%} seen<br>"
        f"{html.escape(status)}<table style='width:100%'>{''.join(rows)}</table></div>"
    )
