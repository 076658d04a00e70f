"""Checks a real image before a prediction is made from it."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import InputError
from scenefw.core.floors import Floor
from scenefw.core.protocols import FloorFinding
from scenefw.core.settings import NOT_NEGATIVE, SHARE, above, between
from scenefw.core.types import Frame
from scenefw.data.files.image_checks import check_depth
from scenefw.perception.observation.colour_alignment import colour_shift
from scenefw.perception.observation.components import TOUCH
from scenefw.perception.observation.depth_reading import better_reading, blended_ratio
from scenefw.perception.observation.floor import FloorFinder
from scenefw.perception.observation.levels import lower_level
from scenefw.perception.observation.object_groups import MAX_UNSAID_RATIO
from scenefw.perception.observation.points import MINORITY
from scenefw.perception.observation.workspace import OUTSIDE_CUBE, Workspace

GOOD, ODD, UNUSABLE = "good", "odd", "unusable"
"""Verdicts: a prediction is made with an odd image, and none of an unusable one."""

_MAX_FOCAL_RATIO = 4.0  # of focal length to a side, or the reverse: views of 14 to 127 degrees
_MAX_PIXELS = 4_000_000  # beyond, time and memory grow and accuracy hardly does
_FIX_SEPARATOR = re.compile(r"; |(?<=\?) ")


@dataclass(frozen=True)
class Check:
    """What was looked at, and what to do about it.

    Args:
        name: of what was looked at, one word or two.
        verdict: `GOOD`, `ODD` or `UNUSABLE`.
        found: what is there, in words.
        fix: what helps, in words; empty if it is good.
    """

    name: str
    verdict: str
    found: str
    fix: str = ""

    @property
    def line(self) -> str:
        """What is there and what helps, as one line."""
        mark = " " if self.found.endswith("?") else "; "
        return f"{self.found}{mark}{self.fix}" if self.fix else self.found

    @classmethod
    def of(cls, name: str, found: str, fix: str, *, is_good: bool) -> "Check":
        """A good check, or an odd one with its fix."""
        return cls(name, GOOD, found) if is_good else cls(name, ODD, found, fix)


NO_OBJECTS = Check(
    "objects",
    ODD,
    "nothing stands on the floor, or only what is flat",
    "check that objects are in view and that the depth scale is right",
)
"""Of an image in which nothing is found."""


@dataclass(frozen=True, eq=False)
class Doctor:
    """Checks units, intrinsics, floor and scale; errors stop, warnings go with the result.

    Args:
        min_distance: the camera should be this far from the stack at least (m).
        max_distance: and at most this far (m).
        min_size: the largest object group should be this large at least (m).
        min_measured_ratio: share of pixels that should have a depth.
        min_tilt: the camera should look down by this much at least (degrees).
        min_alignment: agreement of colour with depth at least (`colour_alignment.ColourShift`). 54
            real images have 0.79 and more; if their colour is moved by 14 to 24 pixels, 45 to 53 of
            them have less than 0.6.

    Raises:
        ConfigError: a negative length, a share outside 0..1, or an angle outside 0..90 degrees.
    """

    min_distance: float = 0.4
    max_distance: float = 1.75
    min_size: float = 0.05
    min_measured_ratio: float = 0.3
    min_tilt: float = 8.0
    min_alignment: float = 0.6

    def __post_init__(self) -> None:
        NOT_NEGATIVE.require(min_distance=self.min_distance, min_size=self.min_size)
        above(self.min_distance, "as it is the farther end").require(max_distance=self.max_distance)
        SHARE.require(min_measured_ratio=self.min_measured_ratio)
        SHARE.require(min_alignment=self.min_alignment)
        between(0, 90).require(min_tilt=self.min_tilt)

    def examine_frame(self, frame: Frame) -> list[str]:
        """Warnings about a frame as read.

        Raises:
            InputError: no depth, the wrong unit, or intrinsics that no camera has.
        """
        return _warnings(self.check_frame(frame))

    def examine_floor(self, frame: Frame, finder: FloorFinding) -> tuple[Floor, list[str]]:
        """The floor of a frame, and warnings about what its numbers mean.

        Raises:
            InputError: it has none.
        """
        floor, checks = self.find_floor(frame, finder)
        return floor, _warnings(checks)

    def examine_workspace(self, floor: Floor, workspace: Workspace) -> list[str]:
        """Warnings about what was found: floor, distance, size of the objects, what is left out."""
        return _warnings([*self.check_floor(floor), *self.check_workspace(workspace)])

    def examine_workspaces(self, workspaces: Sequence[Workspace]) -> list[str]:
        """Warnings about what doesn't fit into the cube of several views, or that it is empty."""
        if not any(workspace.objects.any() for workspace in workspaces):
            return _warnings([NO_OBJECTS])
        others = [check for workspace in workspaces for check in _check_others(workspace)]
        return _warnings([_check_left_out(workspaces[0]), *others])

    def check_frame(self, frame: Frame) -> list[Check]:
        """Unit of the depth, intrinsics, how much is measured, and whether colour is aligned."""
        try:
            check_depth(frame.depth, frame.name)
        except InputError as error:
            return [Check("unit", UNUSABLE, *_split_message(error))]
        median = float(np.median(frame.depth[frame.depth > 0]))
        unit = Check("unit", GOOD, f"the median depth is {median:.2f} m")
        checks = [unit, *_check_intrinsics(frame), self._check_measured(frame)]
        checks += _check_blended(frame)
        checks += self._check_colour(frame)
        checks += [Check("file", ODD, *_split(note)) for note in frame.notes]
        return [*checks, *_check_pixels(frame)]

    def find_floor(self, frame: Frame, finder: FloorFinding) -> tuple[Floor, list[Check]]:
        """The floor of a frame, and whether another reading of its numbers makes a better one.

        Raises:
            InputError: it has none.
        """
        try:
            floor = finder.find(frame)
        except InputError as error:
            reading = better_reading(frame, None, finder)
            if not reading:
                raise
            raise InputError(
                f"{frame.name} has a floor only if its numbers are {reading}; convert them to "
                "depth along the camera's axis"
            ) from error
        reading = better_reading(frame, floor, finder)
        if not reading:
            return floor, []
        finding = f"the floor is bent, and flat if depths are {reading}"
        return floor, [
            Check("depth", ODD, finding, "convert them to depth along the camera's axis")
        ]

    def check_floor(self, floor: Floor) -> list[Check]:
        """Evenness of the floor, how much of it is seen, and how the camera stands over it."""
        deviation = f"{floor.deviation * 1000:.0f} mm"
        support = f"{floor.share:.0%} of the points lie on the floor, {deviation} off it"
        evenness = Check("floor", GOOD, support)
        if floor.deviation > TOUCH:
            finding = f"the floor is uneven or noisy ({deviation})"
            evenness = Check("floor", ODD, finding, "check the intrinsics")
        elif floor.share < FloorFinder.min_inlier_ratio:
            fix = "show more of the table; with floor=known: has the camera moved?"
            evenness = Check("floor", ODD, f"only {support}", fix)
        pitch = float(np.degrees(np.arcsin(np.clip(-floor.normal[2], -1, 1))))
        pose = (
            f"the camera is {floor.height:.2f} m above the floor, looking {pitch:.0f} degrees down"
        )
        fix = "look at the table from higher up, or check the intrinsics"
        return [evenness, Check.of("tilt", pose, fix, is_good=pitch >= self.min_tilt)]

    def check_workspace(self, workspace: Workspace) -> list[Check]:
        """Distance and size of the objects, and what is left out; or that there are none."""
        if not workspace.objects.any():
            return [NO_OBJECTS, *_check_others(workspace)]
        eye = workspace.frame.camera.T_world_camera[:3, 3]
        distance = float(np.linalg.norm(eye - (0, 0, workspace.size[2] / 2)))
        limits = f"{self.min_distance:g} to {self.max_distance:g} m"
        width = float(workspace.size.max())
        is_large = width >= self.min_size
        size = " x ".join(f"{side * 100:.0f}" for side in workspace.size)
        return [
            Check.of(
                "distance",
                f"the camera is {distance:.2f} m from the objects, made for {limits}",
                "move it, or check the depth scale",
                is_good=self.min_distance <= distance <= self.max_distance,
            ),
            Check.of(
                "size",
                f"the objects cover {size} cm"
                if is_large
                else f"the objects are only {width * 100:.1f} cm large",
                "check the depth scale",
                is_good=is_large,
            ),
            _check_left_out(workspace),
            *_check_others(workspace),
        ]

    def _check_measured(self, frame: Frame) -> Check:
        measured_share = float(np.mean(frame.depth > 0))
        is_dense = measured_share >= self.min_measured_ratio
        return Check.of(
            "measured",
            f"{'' if is_dense else 'only '}{measured_share:.0%} of the pixels have a depth",
            "shiny, black or near things have none: change the view or light; leave the table in",
            is_good=is_dense,
        )

    def _check_colour(self, frame: Frame) -> list[Check]:
        shift = None if frame.colour is None else colour_shift(frame.depth, frame.colour)
        if shift is None:
            return []
        if shift.agreement >= self.min_alignment:
            return [Check("colour", GOOD, "edges of colour lie where depth jumps")]
        directions = (
            (shift.columns, "to the left", "to the right"),
            (shift.rows, "above", "below"),
        )
        offsets = [
            f"{abs(n)} pixels {negative_side if n < 0 else positive_side}"
            for n, negative_side, positive_side in directions
            if n
        ]
        finding = (
            f"edges of colour seem to lie {' and '.join(offsets)}, seen from where depth jumps"
        )
        fix = "align colour to depth with your camera's software, or leave it out"
        return [Check("colour", ODD, finding, fix)]


def _check_pixels(frame: Frame) -> list[Check]:
    """Whether the image is larger than it need be."""
    if frame.depth.size <= _MAX_PIXELS:
        return []
    height, width = frame.depth.shape
    stride = int(np.ceil(np.sqrt(frame.depth.size / _MAX_PIXELS)))
    finding = f"{width} x {height} pixels take long and much memory"
    fix = f"give depth[::{stride}, ::{stride}] (masks too), and fx, fy, cx, cy divided by {stride}"
    return [Check("pixels", ODD, finding, fix)]


def _check_intrinsics(frame: Frame) -> list[Check]:
    camera = frame.camera
    sizes = ((camera.width, camera.fx), (camera.height, camera.fy))
    views = [float(np.degrees(2 * np.arctan(side / (2 * focal)))) for side, focal in sizes]
    angles = f"{views[0]:.0f} x {views[1]:.0f} degrees"
    if not all(1 / _MAX_FOCAL_RATIO < focal / side < _MAX_FOCAL_RATIO for side, focal in sizes):
        finding = (
            f"intrinsics of {frame.name} give a view of {angles} with fx = {camera.fx:g} at "
            f"{camera.width} x {camera.height} pixels"
        )
        fix = "give fx, fy, cx, cy in pixels of this image size"
        return [Check("intrinsics", UNUSABLE, finding, fix)]
    has_square_pixels = abs(camera.fx / camera.fy - 1) < MINORITY
    offset = (camera.cx / camera.width - 0.5, camera.cy / camera.height - 0.5)
    transposed_offset = (camera.cx / camera.height - 0.5, camera.cy / camera.width - 0.5)
    is_swapped = max(np.abs(transposed_offset)) < MINORITY < max(np.abs(offset))
    is_central = max(np.abs(offset)) <= MINORITY and not is_swapped
    return [
        Check.of(
            "intrinsics",
            f"the view is {angles}"
            if has_square_pixels
            else f"fx = {camera.fx:g} and fy = {camera.fy:g} differ",
            "check the intrinsics",
            is_good=has_square_pixels,
        ),
        Check.of(
            "centre",
            f"the intrinsics' centre ({camera.cx:g}, {camera.cy:g}) is "
            f"{'near' if is_central else 'far from'} the middle of the image",
            "swap cx and cy, or is the image turned?"
            if is_swapped
            else "are they of another image size, or is the image a part of one?",
            is_good=is_central,
        ),
    ]


def _check_blended(frame: Frame) -> list[Check]:
    """Whether depth was interpolated across what wasn't measured."""
    if blended_ratio(frame.depth) < MINORITY:
        return []
    finding = "depth falls evenly to 0 beside what isn't measured, as after resizing or smoothing"
    return [Check("edges", ODD, finding, "resize with nearest neighbours, and don't smooth")]


def _check_lower_surface(workspace: Workspace) -> list[Check]:
    """Another table, lower down, on which nothing is looked for."""
    depth = lower_level(workspace.points[..., 2])
    if depth is None:
        return []
    finding = f"another surface lies {100 * depth:.0f} cm lower, and what stands on it is left out"
    return [Check("lower", ODD, finding, "take a picture of it alone")]


def _check_left_out(workspace: Workspace) -> Check:
    if not len(workspace.left_out):
        return Check("groups", GOOD, "all objects fit into the cube")
    positions = ", ".join(f"({x:.2f}, {y:.2f})" for x, y in workspace.left_out)
    return Check(
        "groups",
        ODD,
        f"{len(workspace.left_out)} object group(s) at x, y = {positions} m don't fit into the "
        "cube with the others and are left out",
        "take a picture of each group",
    )


def _check_others(workspace: Workspace) -> list[Check]:
    """What rises above the floor and isn't taken for an object."""
    return [
        *_check_flat(workspace),
        *_check_other_surfaces(workspace),
        *_check_lower_surface(workspace),
    ]


def _check_flat(workspace: Workspace) -> list[Check]:
    if not workspace.flat:
        return []
    finding = (
        f"{len(workspace.flat)} thing(s) too flat for an object, the largest at the "
        f"{place_in_words(workspace.flat[0])} of the image"
    )
    return [Check("flat", ODD, finding, "mark them (run.masks)")]


def _check_other_surfaces(workspace: Workspace) -> list[Check]:
    """Large surfaces, in shares of all that rises."""
    masks = {region.kind: region.pixels for region in workspace.obstacles}
    masks["what stands beside the floor"] = workspace.unsupported
    total = workspace.objects.sum() + sum(mask.sum() for mask in masks.values())
    parts = [
        f"{mask.sum() / total:.0%} {kind} at the {place_in_words(mask)}"
        for kind, mask in masks.items()
        if kind != OUTSIDE_CUBE and mask.sum() > MAX_UNSAID_RATIO * total
    ]
    if not parts:
        return []
    finding = f"part of what rises above the floor is no object: {', '.join(parts)} of the image"
    return [Check("others", ODD, finding, "if they are, mark them (run.masks)")]


def place_in_words(mask: NDArray[np.bool_]) -> str:
    """Where most pixels (H, W) are, in words."""
    rows, columns = np.nonzero(mask)
    row = int(3 * np.median(rows) / mask.shape[0])
    column = int(3 * np.median(columns) / mask.shape[1])
    words = [("top", "", "bottom")[row], ("left", "", "right")[column]]
    return " ".join(word for word in words if word) or "middle"


def unusable(name: str, error: InputError) -> Check:
    """A check that ended with an error."""
    return Check(name, UNUSABLE, *_split_message(error))


def _split_message(error: InputError) -> tuple[str, str]:
    """What is wrong, and what helps: errors say both in one line."""
    return _split(str(error))


def _split(line: str) -> tuple[str, str]:
    finding, *fixes = _FIX_SEPARATOR.split(line, maxsplit=1)
    return finding, "".join(fixes)


def _warnings(checks: Sequence[Check]) -> list[str]:
    for check in checks:
        if check.verdict == UNUSABLE:
            raise InputError(check.line)
    return [check.line for check in checks if check.verdict == ODD]
