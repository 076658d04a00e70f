"""Path tracing of table-top scenes with Mitsuba 3: soft shadows, light between objects."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import MissingDependencyError
from scenefw.core.height_maps import HeightGrid, HeightMap
from scenefw.core.settings import COUNT, POSITIVE
from scenefw.core.tabletop import TabletopGeometry
from scenefw.core.types import Camera, Frame
from scenefw_annotated_views.baking import colour_of_points, refined, table_image

_HALF = 2.0  # m: half of the side of the table that is drawn
_TABLE_PIXELS = 2048
_ABOVE = 0.45  # m: height of the eye of maps, under the lamps
_GAMMA = 1 / 2.2


class PhysicallyBased:
    """Renders scenes by path tracing with Mitsuba 3 (Jakob et al. 2022), seconds per view.

    Lamps are glowing balls, the light of the room comes from everywhere, surfaces are matt.
    Depth and labels come from Mitsuba's own rays through pixel centres. The table ends 2 m from
    its middle: pixels beyond have depth 0 and label -1.

    Args:
        samples: paths per pixel.
        bounces: longest path, in reflections.
        lamp_radius: of lamps (m); the larger, the softer the shadows.
        detail: textures on objects are sampled at least this finely (m).

    Raises:
        ConfigError: no samples, no bounces, or lengths of 0.
    """

    def __init__(
        self,
        samples: int = 64,
        bounces: int = 3,
        lamp_radius: float = 0.06,
        detail: float = 0.004,
    ) -> None:
        COUNT.require(samples=samples, bounces=bounces)
        POSITIVE.require(lamp_radius=lamp_radius, detail=detail)
        self.samples, self.bounces = samples, bounces
        self.lamp_radius, self.detail = lamp_radius, detail
        self._last: tuple[TabletopGeometry, _World] | None = None

    def fingerprint(self) -> str:
        """Changes with whatever changes the images."""
        settings = (self.samples, self.bounces, self.lamp_radius, self.detail)
        return f"PhysicallyBased {settings} mitsuba {_mitsuba().__version__} 1"

    def frames(self, geometry: TabletopGeometry, cameras: Sequence[Camera]) -> Iterator[Frame]:
        """One frame per camera: z-depth (0 = beyond the table), colour, class ids."""
        world = self._world(geometry)
        for camera in cameras:
            v, u = np.mgrid[: camera.height, : camera.width]
            pixels = np.stack([u, v, np.ones_like(u)], axis=-1).reshape(-1, 3)
            ahead = pixels @ np.linalg.inv(camera.matrix).T @ camera.T_world_camera[:3, :3].T
            eye = np.broadcast_to(camera.T_world_camera[:3, 3], ahead.shape)
            depth, labels = world.cast(eye, ahead)
            shape = (camera.height, camera.width)
            colour = world.colour(_perspective(camera), shape, self.samples, self.bounces)
            yield Frame(depth.reshape(shape), camera, colour, labels.reshape(shape), geometry.name)

    def height_map(self, geometry: TabletopGeometry, grid: HeightGrid) -> HeightMap:
        """The scene from straight above: heights, colour and labels of every vertex."""
        world = self._world(geometry)
        places = grid.positions().reshape(-1, 2)
        eye = np.column_stack([places, np.full(len(places), _ABOVE)])
        depth, labels = world.cast(eye, np.broadcast_to([0.0, 0.0, -1.0], eye.shape))
        colour = world.colour(_orthographic(grid), grid.shape, self.samples, self.bounces)
        return HeightMap(
            grid,
            (_ABOVE - depth).reshape(grid.shape).clip(min=0).astype(np.float32),
            colour,
            np.ones(grid.shape, dtype=np.float32),
            np.zeros(grid.shape, dtype=np.float32),
            labels=labels.reshape(grid.shape),
            classes=geometry.classes,
        )

    def _world(self, geometry: TabletopGeometry) -> _World:
        if self._last is None or self._last[0] is not geometry:
            self._last = (geometry, _World(geometry, self.lamp_radius, self.detail))
        return self._last[1]


class _World:
    """A scene in Mitsuba's terms: one mesh of all objects, a square of table, lamps."""

    def __init__(self, geometry: TabletopGeometry, radius: float, detail: float) -> None:
        self.mi = _mitsuba()
        finer, _ = refined(geometry, detail)
        self.labels = finer.labels[finer.item_of] if len(finer.labels) else finer.item_of
        self.parts: dict[str, Any] = {"type": "scene", "table": self._table(geometry)}
        self.parts["room"] = {"type": "constant", "radiance": self._rgb(geometry.ambient)}
        if len(finer.corners):
            self.parts["objects"] = self._mesh(finer)
        for number, lamp in enumerate(geometry.lights):
            # Our lamps state what arrives at the middle of the table, a matt white one shows it.
            radiance = lamp[3:] * (lamp[:3] ** 2).sum() / radius**2
            self.parts[f"lamp{number}"] = {
                "type": "sphere", "center": lamp[:3].tolist(), "radius": radius,
                "emitter": {"type": "area", "radiance": self._rgb(radiance)},
            }  # fmt: skip
        self.scene = self.mi.load_dict(self.parts)

    def cast(self, eye: NDArray, ahead: NDArray) -> tuple[NDArray, NDArray]:
        """Distance in lengths of `ahead` and class id of each ray; 0 and -1 where nothing is."""
        depth = np.zeros(len(eye), dtype=np.float32)
        labels = np.full(len(eye), -1, dtype=np.int32)
        length = np.linalg.norm(ahead, axis=1)
        directions = (ahead / length[:, None]).tolist()
        for i, (origin, direction) in enumerate(zip(eye.tolist(), directions, strict=True)):
            hit = self.scene.ray_intersect_preliminary(self.mi.Ray3f(origin, direction))
            if hit.is_valid():
                name = hit.shape.id()
                if name in ("table", "objects"):
                    depth[i] = hit.t / length[i]
                    labels[i] = 0 if name == "table" else self.labels[hit.prim_index]
        return depth, labels

    def colour(
        self, sensor: dict[str, Any], shape: tuple[int, int], samples: int, bounces: int
    ) -> NDArray[np.uint8]:
        """What a sensor sees, (H, W, 3)."""
        film = {"type": "hdrfilm", "height": shape[0], "width": shape[1], "pixel_format": "rgb",
                "rfilter": {"type": "box"}}  # fmt: skip
        sampler = {"type": "independent", "sample_count": samples}
        turned = self.mi.ScalarTransform4f(sensor["to_world"])
        built = self.mi.load_dict({**sensor, "to_world": turned, "film": film, "sampler": sampler})
        path = self.mi.load_dict({"type": "path", "max_depth": bounces + 1, "hide_emitters": True})
        radiance = np.array(self.mi.render(self.scene, sensor=built, integrator=path, spp=samples))
        pixels = radiance[..., :3].clip(0, 1) ** _GAMMA * 255
        return np.rint(pixels).astype(np.uint8)

    def _rgb(self, values: NDArray) -> dict[str, Any]:
        return {"type": "rgb", "value": [float(x) for x in values]}

    def _table(self, geometry: TabletopGeometry) -> dict[str, Any]:
        image = table_image(geometry, _HALF, _TABLE_PIXELS)[::-1]  # its rows go up
        bitmap = self.mi.Bitmap(np.ascontiguousarray(image, dtype=np.float32))
        texture = {"type": "bitmap", "bitmap": bitmap, "raw": True}
        return {
            "type": "rectangle", "id": "table",
            "to_world": self.mi.ScalarTransform4f(np.diag([_HALF, _HALF, 1.0, 1.0])),
            "bsdf": {"type": "twosided", "nested": {"type": "diffuse", "reflectance": texture}},
        }  # fmt: skip

    def _mesh(self, geometry: TabletopGeometry) -> Any:
        points = geometry.corners.reshape(-1, 3)
        face = np.repeat(np.arange(len(geometry.corners), dtype=np.int32), 3)
        colour = colour_of_points(geometry, points, face)
        reflectance = {"type": "mesh_attribute", "name": "vertex_color"}
        properties = self.mi.Properties()
        properties["mesh_bsdf"] = self.mi.load_dict(
            {"type": "twosided", "nested": {"type": "diffuse", "reflectance": reflectance}}
        )
        properties.set_id("objects")
        mesh = self.mi.Mesh(
            "objects", len(points), len(geometry.corners), has_vertex_normals=True,
            props=properties,
        )  # fmt: skip
        mesh.add_attribute("vertex_color", 3, colour.ravel().tolist())
        values = self.mi.traverse(mesh)
        values["vertex_positions"] = points.ravel()
        values["vertex_normals"] = geometry.normals.ravel()
        values["faces"] = np.arange(len(points), dtype=np.uint32)
        values.update()
        return mesh


def _perspective(camera: Camera) -> dict[str, Any]:
    """Mitsuba's cameras look along z with x to the left and y up."""
    return {
        "type": "perspective",
        "fov": float(np.rad2deg(2 * np.arctan(camera.width / (2 * camera.fx)))),
        "fov_axis": "x",
        "principal_point_offset_x": 0.5 - (camera.cx + 0.5) / camera.width,
        "principal_point_offset_y": 0.5 - (camera.cy + 0.5) / camera.height,
        "near_clip": 0.01,
        "far_clip": 20.0,
        "to_world": camera.T_world_camera @ np.diag([-1.0, -1.0, 1.0, 1.0]),
    }


def _orthographic(grid: HeightGrid) -> dict[str, Any]:
    """Pixel centres on the vertices, x to the right and y up."""
    half = (grid.extent + grid.spacing) / 2
    pose = np.diag([-half, half, -1.0, 1.0])  # x to the right of the image is Mitsuba's -x
    pose[:3, 3] = [grid.lower[0] + grid.extent / 2, grid.lower[1] + grid.extent / 2, _ABOVE]
    return {"type": "orthographic", "near_clip": 0.01, "far_clip": 20.0, "to_world": pose}


def _mitsuba() -> Any:
    try:
        import mitsuba
    except ImportError as error:
        raise MissingDependencyError(
            "renderer physically_based needs Mitsuba: pip install 'scenefw[physically_based]'; "
            "renderer=mesh_raycaster needs nothing"
        ) from error
    if mitsuba.variant() != "scalar_rgb":
        mitsuba.set_variant("scalar_rgb")
    return mitsuba
