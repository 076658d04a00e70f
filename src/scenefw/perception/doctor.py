"""Checks a real image before a prediction is made from it."""

import numpy as np

from scenefw.core.errors import InputError
from scenefw.core.types import Frame
from scenefw.data.readers import check_depth
from scenefw.perception.floor import Floor
from scenefw.perception.workspace import Workspace

_FIELD_OF_VIEW = (15.0, 120.0)
_FOCAL_RATIO = 1.2
_OFF_CENTRE = 0.25
_STACK_HEIGHT = 0.1  # where the middle of a stack is assumed, for its distance (m)


class Doctor:
    """Checks units, intrinsics, floor and scale; errors stop, warnings go with the result.

    Args:
        nearest: the camera should be this far from the stack at least (m).
        farthest: and at most this far (m).
        smallest: the largest object group should be this large at least (m).
        least_measured: share of pixels that should have a depth.
    """

    def __init__(
        self,
        nearest: float = 0.4,
        farthest: float = 1.75,
        smallest: float = 0.05,
        least_measured: float = 0.3,
    ) -> None:
        self.nearest = nearest
        self.farthest = farthest
        self.smallest = smallest
        self.least_measured = least_measured

    def examine_frame(self, frame: Frame) -> list[str]:
        """Warnings about a frame as read.

        Raises:
            InputError: no depth, the wrong unit, or intrinsics that no camera has.
        """
        check_depth(frame.depth, frame.name)
        camera = frame.camera
        sizes = ((camera.width, camera.fx), (camera.height, camera.fy))
        views = [float(np.degrees(2 * np.arctan(side / (2 * focal)))) for side, focal in sizes]
        warnings = []
        if not all(_FIELD_OF_VIEW[0] < view < _FIELD_OF_VIEW[1] for view in views):
            raise InputError(
                f"intrinsics of {frame.name} give a view of {views[0]:.0f} x {views[1]:.0f} "
                f"degrees with fx = {camera.fx:g} at {camera.width} x {camera.height} pixels; give "
                "fx, fy, cx, cy in pixels of this image size"
            )
        if not 1 / _FOCAL_RATIO < camera.fx / camera.fy < _FOCAL_RATIO:
            warnings.append(
                f"fx = {camera.fx:g} and fy = {camera.fy:g} differ; check the intrinsics"
            )
        off = (camera.cx / camera.width - 0.5, camera.cy / camera.height - 0.5)
        if max(np.abs(off)) > _OFF_CENTRE:
            warnings.append(
                f"the intrinsics' centre ({camera.cx:g}, {camera.cy:g}) is far from the middle of "
                "the image; are they of another image size?"
            )
        measured = float(np.mean(frame.depth > 0))
        if measured < self.least_measured:
            warnings.append(f"only {measured:.0%} of the pixels have a depth")
        return warnings

    def examine_workspace(self, floor: Floor, workspace: Workspace) -> list[str]:
        """Warnings about what was found: floor, distance, size of the objects, what is left out."""
        warnings = []
        eye = workspace.frame.camera.T_world_camera[:3, 3]
        distance = float(np.linalg.norm(eye - (0, 0, _STACK_HEIGHT)))
        if not self.nearest <= distance <= self.farthest:
            warnings.append(
                f"the camera is {distance:.2f} m from the objects, made for {self.nearest:g} to "
                f"{self.farthest:g} m; move it, or check the depth scale"
            )
        width = float(workspace.size.max())
        if width < self.smallest:
            warnings.append(
                f"the objects are only {width * 100:.1f} cm large; check the depth scale"
            )
        if len(workspace.left_out):
            where = ", ".join(f"({x:.2f}, {y:.2f})" for x, y in workspace.left_out)
            warnings.append(
                f"{len(workspace.left_out)} object group(s) at x, y = {where} m don't fit into the "
                "cube with the others and are left out; take a picture of each group"
            )
        if floor.deviation > 0.01:
            warnings.append(
                f"the floor is uneven or noisy ({floor.deviation * 1000:.0f} mm); "
                "check the intrinsics"
            )
        return warnings
