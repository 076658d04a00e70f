"""The 3D nodes of a viewer: points, floor, slice, objects with captions, and a gizmo."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.core.geometry import inverse, rotation_from_quaternion, transform_points
from scenefw.core.types import Pose
from scenefw.report.palette import instance_colours
from scenefw_viewer import layers

if TYPE_CHECKING:
    from collections.abc import Callable

    from scenefw.core.types import Float64, ObjectEstimate, TriangleMesh
    from scenefw_viewer.edits import Edits
    from scenefw_viewer.layers import Prediction

LAYERS = (
    "points",
    "truth",
    "floor",
    "camera",
    "slice",
    "objects",
    "superquadrics",
    "captions",
    "obstacles",
)
_POINT = 0.0025  # m
_TRUE_POINT = 0.0035
_FLOOR_SIDE = 1.6
_BELOW = 0.006  # m: or measured points of the floor hide parts of its grid
_ABOVE = 0.02  # m between an object and its caption
_FRUSTUM = 0.08
_OBSTACLE = (150, 150, 158)


class Stage:
    """Nodes of a viser scene; `/objects/3` has the pose of object 3 and its mesh below it.

    Args:
        scene: of a viser server.
        selected: called with the id of an object that was clicked.
        placed: called with the id and the new 4x4 pose of an object that was dragged.
    """

    def __init__(
        self,
        scene: Any,
        selected: Callable[[int], None],
        placed: Callable[[int, Float64], None],
    ) -> None:
        self.scene, self._selected, self._placed = scene, selected, placed
        self._roots: dict[str, Any] = {}
        self._nodes: dict[int, list[Any]] = {}
        self._gizmo: Any = None
        self._truth: Any = None
        self._obstacles: list[Any] = []
        for name in LAYERS:
            self._roots[name] = scene.add_frame(f"/{name}", show_axes=False)
        scene.add_grid(
            "/floor/grid", _FLOOR_SIDE, _FLOOR_SIDE, cell_size=0.05, section_size=0.5,
            cell_color=(222, 224, 228), section_color=(178, 184, 192), fade_strength=0.0,
            position=(0.0, 0.0, -_BELOW),
        )  # fmt: skip

    def toggle(self, layer: str, visible: bool) -> None:
        """Shows or hides one of `LAYERS`."""
        self._roots[layer].visible = visible

    def is_visible(self, layer: str) -> bool:
        """Whether a layer is visible."""
        return bool(self._roots[layer].visible)

    def show_image(self, prediction: Prediction) -> None:
        """Points of an image, of its truth, obstacles, and the camera."""
        points, colours = layers.cloud(prediction)
        self._points("/points/seen", points, colours, _POINT)
        if self._truth is not None:
            self._truth.remove()
        true = layers.truth(prediction)
        self._truth = true and self._points("/truth/seen", *true, _TRUE_POINT)
        for node in self._obstacles:
            node.remove()
        self._obstacles = [
            self.scene.add_mesh_simple(
                f"/obstacles/{number}", obstacle.mesh.vertices.astype(np.float32),
                obstacle.mesh.faces.astype(np.uint32), color=_OBSTACLE, side="double",
            )
            for number, obstacle in enumerate(prediction.scenes[0].obstacles)
        ]  # fmt: skip
        camera = prediction.scenes[0].frame.camera
        pose = Pose.from_matrix(camera.T_world_camera)
        step = max(1, camera.width // 320)
        self.scene.add_camera_frustum(
            "/camera/image",
            2 * float(np.arctan(camera.height / 2 / camera.fy)),
            camera.width / camera.height,
            scale=_FRUSTUM,
            thickness=0.002,
            color=(90, 98, 110),
            image=None
            if prediction.frame.colour is None
            else prediction.frame.colour[::step, ::step],
            wxyz=pose.quaternion,
            position=pose.position,
        )

    def _points(self, name: str, points: Any, colours: Any, size: float) -> Any:
        return self.scene.add_point_cloud(
            name, points, colours, point_size=size, point_shape="circle",
            point_shading="flat", precision="float32",
        )  # fmt: skip

    def show_slice(self, part: layers.Slice) -> None:
        """A plane through the partial TSDF."""
        self.scene.add_image(
            "/slice/partial", part.picture, part.size, part.size, format="png",
            position=part.position, wxyz=part.quaternion, cast_shadow=False, receive_shadow=False,
        )  # fmt: skip

    def show_objects(self, edits: Edits) -> None:
        """All objects of a scene, in place of those before."""
        self.hold(None, edits)
        for node in [node for nodes in self._nodes.values() for node in nodes]:
            node.remove()
        self._nodes = {item.id: self._object(item) for item in edits.scene.objects}
        for label in edits.ids:
            self.update(label, edits)

    def _object(self, item: ObjectEstimate) -> list[Any]:
        """The nodes that move with an object: frame of its mesh, of its superquadric, caption."""
        colour = instance_colours(item.id)[-1]
        frame = self.scene.add_frame(f"/objects/{item.id}", show_axes=False)
        mesh = self._mesh(f"/objects/{item.id}/surface", item.mesh, item, color=colour)
        mesh.on_click(lambda _: self._selected(item.id))
        caption = self.scene.add_label(
            f"/captions/{item.id}", layers.caption(item), anchor="bottom-center",
            font_screen_scale=0.8,
        )  # fmt: skip
        if item.placed is None:
            return [frame, caption]
        below = self.scene.add_frame(f"/superquadrics/{item.id}", show_axes=False)
        self._mesh(
            f"/superquadrics/{item.id}/surface", item.placed.mesh(), item, color=(40, 44, 52),
            wireframe=True, opacity=0.35, cast_shadow=False,
        )  # fmt: skip
        return [frame, caption, below]

    def _mesh(self, name: str, mesh: TriangleMesh, item: ObjectEstimate, **looks: Any) -> Any:
        vertices = transform_points(inverse(item.pose.matrix), mesh.vertices)
        return self.scene.add_mesh_simple(
            name, vertices.astype(np.float32), mesh.faces.astype(np.uint32), **looks
        )

    def update(self, label: int, edits: Edits) -> None:
        """Shows an object where it is now, or hides it if it was taken away."""
        frame, caption, *shape_frames = self._nodes[label]
        pose = Pose.from_matrix(edits.pose(label))
        for node in (frame, *shape_frames):
            node.position, node.wxyz = pose.position, pose.quaternion
        points = transform_points(edits.motion(label), edits.item(label).mesh.vertices)
        caption.position = np.append(pose.position[:2], points[:, 2].max() + _ABOVE)
        for node in self._nodes[label]:
            node.visible = label not in edits.removed

    def hold(self, label: int | None, edits: Edits) -> None:
        """Puts the gizmo on an object, or away."""
        if self._gizmo is not None:
            self._gizmo.remove()
            self._gizmo = None
        if label is None or label in edits.removed:
            return
        pose = Pose.from_matrix(edits.pose(label))
        gizmo = self.scene.add_transform_controls(
            "/gizmo", scale=float(max(edits.item(label).extents)), depth_test=False,
            position=pose.position, wxyz=pose.quaternion,
        )  # fmt: skip
        gizmo.on_update(lambda _: self._placed(label, _matrix(gizmo)))
        self._gizmo = gizmo


def _matrix(node: Any) -> Float64:
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_from_quaternion(np.asarray(node.wxyz, np.float64))
    matrix[:3, 3] = node.position
    return matrix
