"""Edges of depth images, restored where a stereo camera has blurred them into ramps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import distance_transform_edt, find_objects

from scenefw.core.settings import COUNT, at_least
from scenefw.kernels.cameras import floor_depths, stack_cameras
from scenefw.perception.observation.components import EDGE, NOISE, TOUCH, neighbours
from scenefw.perception.observation.pixels import WIDTH
from scenefw.perception.segmentation.ramp_width import ramp_width

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.protocols import MappingMethod
    from scenefw.core.types import Float32, Float64, Int32
    from scenefw.perception.observation.observation import Observation
    from scenefw.perception.segmentation.colour_edges import ColourEdges


@dataclass(frozen=True, eq=False)
class EdgeRestoration:
    """Gives images of stereo cameras the edges back that windows have blurred.

    Such a camera matches windows. Across an edge, depth leads in a ramp from the object to what is
    behind; the edge is in the middle of the ramp. A network says where objects end. How wide ramps
    are is seen on the floor, whose heights are known: beside objects it seems to rise. If it does,
    over `min_width` pixels or more, pixels of an object that are so close to its end continue the
    object's surface, and those of the floor lie on it. This is done where depth then jumps:
    where two parts touch, or a part stands on the floor, nothing was blurred.

    Images without correlated noise, and images without ramps, stay as they are. Parts are those of
    the image as it was: of what is restored, ends of ramps would be parts of their own.

    Args:
        mapping: makes the partial TSDF of what is restored.
        min_width: pixels from an edge to the end of its ramp, at least.
        max_width: the same, at most; both of an image 640 wide.
        colour: moves ends of parts to edges of the colour image first, where there is one; None:
            they stay in the middle of ramps. Masks that come with the view are not moved.

    Raises:
        ConfigError: less than one pixel, or a narrowest ramp that is wider than the widest.
    """

    mapping: MappingMethod
    min_width: float = 2.0
    max_width: float = 12.0
    colour: ColourEdges | None = None

    def __post_init__(self) -> None:
        COUNT.require(min_width=self.min_width, max_width=self.max_width)
        at_least(self.min_width).require(max_width=self.max_width)

    def restore(self, view: Observation, parts: Int32) -> tuple[Observation, Int32]:
        """The view with restored depth, and the parts (H, W) in it; or both as they were.

        Args:
            view: as measured.
            parts: (H, W) of its image, 0 = none. If someone has marked them, they stay.
        """
        if not parts.any() or not view.noise.is_correlated:
            return view, parts
        if self.colour is not None and view.masks is None:
            parts = self.colour.moved(parts, view)
        scale, camera = view.depth.shape[1] / WIDTH, view.camera
        distance = distance_transform_edt(parts == 0)
        width = ramp_width(view.heights, distance, round(self.max_width * scale))
        if width < self.min_width * scale:
            return view, parts
        depth = continued(view.depth, parts, width)
        on_floor = (distance > 0) & (distance <= width + 1)
        on_floor &= (view.heights > NOISE) & (view.heights < view.eye[2])  # its ray goes down
        depth = np.where(on_floor, floor_depths(stack_cameras([camera]))[0].numpy(), depth)
        beside_jump = distances(jumps(depth, parts, EDGE)) <= width + 1
        return view.restored(np.where(beside_jump, depth, view.depth), self.mapping), parts


def continued(depth: Float32, parts: Int32, width: int) -> Float32:
    """Depth (H, W) whose pixels within `width` of the end of a part continue its surface.

    Inverse depth is linear along a plane. So a pixel gets twice that of the nearest pixel inside,
    less that of the one as far again inside, if it is of the same surface.

    Args:
        depth: (H, W) metres, 0 = no measurement.
        parts: (H, W), 0 = none.
        width: pixels.
    """
    inside = (distances(jumps(depth, parts)) > width) & (depth > 0)
    restored_depth = depth.copy()
    for label, box in enumerate(find_objects(parts), start=1):
        if box is None:
            continue
        part_mask, image = parts[box] == label, depth[box]
        core = part_mask & inside[box]
        if not core.any():
            continue
        distance, nearest = distance_transform_edt(~core, return_indices=True)
        pixels = np.nonzero(part_mask & ~core & (image > 0) & (distance <= 2 * width + 2))
        core_pixels = tuple(axis[pixels] for axis in nearest)
        mirrored_pixels = tuple(
            np.clip(2 * h - a, 0, size - 1)
            for h, a, size in zip(core_pixels, pixels, image.shape, strict=True)
        )
        core_depth, mirrored_depth = image[core_pixels], image[mirrored_pixels]
        same_surface = core[mirrored_pixels] & (np.abs(mirrored_depth - core_depth) < TOUCH)
        restored_depth[box][pixels] = 1 / np.where(
            same_surface,
            2 / core_depth - 1 / np.where(same_surface, mirrored_depth, 1),
            1 / core_depth,
        )
    return restored_depth


def jumps(depth: Float32, parts: Int32, min_step: float = 0.0) -> NDArray[np.bool_]:
    """Pixels (H, W) beside which another part is, or none, in another depth.

    Args:
        depth: (H, W) metres, 0 = no measurement.
        parts: (H, W), 0 = none.
        min_step: by how much depth differs there (m); 0 takes all ends of parts.
    """
    edges = np.zeros(parts.shape, dtype=bool)
    for first, second in neighbours():
        ends = parts[first] != parts[second]
        if min_step:
            measured = (depth[first] > 0) & (depth[second] > 0)
            ends &= measured & (np.abs(depth[first] - depth[second]) >= min_step)
        edges[first] |= ends
        edges[second] |= ends
    return edges


def distances(mask: NDArray[np.bool_]) -> Float64:
    """Pixels (H, W) to the nearest marked one, infinite if none is."""
    if not mask.any():
        return np.full(mask.shape, np.inf)
    return np.asarray(distance_transform_edt(~mask))
