"""Editing scenes by hand: take objects away, move, scale, swap and add them, join two scenes.

Objects never change: each function returns new ones. Ids stay, and new objects get the next ones.
"""

from __future__ import annotations

import operator
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from scenefw.core.errors import InputError, require_number
from scenefw.core.geometry import rigid, transform_points
from scenefw.core.types import (
    Float64,
    GridSpec,
    ObjectEstimate,
    PlacedShape,
    Pose,
    SceneEstimate,
    TriangleMesh,
)
from scenefw.perception.estimate.base_frame import CAMERA_IN_BASE
from scenefw.perception.estimate.objects import estimate_objects
from scenefw.perception.estimate.transforms import moved_object
from scenefw.perception.evidence.mesh_distances import mesh_volumes
from scenefw.shapes.superellipsoid import Superellipsoid
from scenefw.shapes.superquadric import Superquadric
from scenefw.shapes.vessel import Vessel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from scenefw.core.types import Shape

Objects = tuple[ObjectEstimate, ...]

_MAX_DISTANCE = 100.0  # m, of centres from the origin
_MAX_FACTOR = 1000.0  # of scaling
_IMAGE_DETAILS = (CAMERA_IN_BASE, "floor", "checkpoint", "samples", "seed")
"""Details that hold after edits too."""


def named(objects: Objects, label: int) -> ObjectEstimate:
    """The object with this id.

    Raises:
        InputError: there is none.
    """
    for item in objects:
        if item.id == label:
            return item
    ids = ", ".join(str(item.id) for item in objects) or "none"
    raise InputError(f"there is no object {label}; the scene has {ids}")


def removed(objects: Objects, label: int) -> Objects:
    """Without an object.

    Raises:
        InputError: there is no such object.
    """
    removed_item = named(objects, label)
    return tuple(item for item in objects if item is not removed_item)


def moved_by(
    objects: Objects,
    label: int,
    by: ArrayLike = (0.0, 0.0, 0.0),
    turn: float = 0.0,
    axis: ArrayLike = (0.0, 0.0, 1.0),
) -> Objects:
    """With an object elsewhere.

    Args:
        objects: of the scene.
        label: id of the object.
        by: x, y, z along the world's axes (m).
        turn: degrees about an axis through its centre of mass.
        axis: of the world; the default is the vertical.

    Raises:
        InputError: there is no such object, or numbers are wrong.
    """
    item, shift = named(objects, label), _vector(by, "the move")
    direction = _vector(axis, "the axis")
    require_number(turn, "turn", "degrees")
    length = float(np.linalg.norm(direction))
    if length == 0 or not np.isfinite(turn):
        raise InputError(
            f"turn {turn} about {list(direction)}: expected degrees and an axis, not 0"
        )
    rotation = Rotation.from_rotvec(direction / length * turn, degrees=True).as_matrix()
    centre = item.pose.position
    motion = rigid(rotation, centre + shift - rotation @ centre)
    return _replace_object(objects, _require_reach(moved_object(item, motion)))


def scaled(objects: Objects, label: int, factor: float) -> Objects:
    """With an object larger or smaller; where it stands, it goes on standing.

    Args:
        objects: of the scene.
        label: id of the object.
        factor: of all its lengths.

    Raises:
        InputError: there is no such object, or the factor is not positive.
    """
    require_number(factor, "factor", "a number above 0, such as 2")
    if not 1 / _MAX_FACTOR <= factor <= _MAX_FACTOR:
        raise InputError(
            f"factor {factor:g} of object {label}: expected a number from {1 / _MAX_FACTOR:g} to "
            f"{_MAX_FACTOR:g}, such as 2"
        )
    item = named(objects, label)
    centre = item.pose.position
    mesh = TriangleMesh(centre + factor * (item.mesh.vertices - centre), item.mesh.faces)
    up = np.array([0.0, 0.0, item.mesh.vertices[:, 2].min() - mesh.vertices[:, 2].min()])
    scaled_item = replace(
        item,
        mesh=mesh,
        extents=np.asarray(item.extents) * factor,
        placed=item.placed and _scaled_shape(item.placed, factor, centre),
    )
    return _replace_object(objects, _require_reach(moved_object(scaled_item, rigid(np.eye(3), up))))


def swapped(objects: Objects, first: int, second: int) -> Objects:
    """With the shapes of two objects exchanged.

    Each shape goes to the centre and the axes of the other one, longest axis along longest, and
    stands as high as the other one did. Ids stay with the places.

    Raises:
        InputError: there is no such object, or both are one.
    """
    a, b = named(objects, first), named(objects, second)
    if a is b:
        raise InputError(f"object {first} can't be swapped with itself; give two ids")
    objects = _replace_object(objects, _in_place_of(a, b))
    return _replace_object(objects, _in_place_of(b, a))


def added(
    objects: Objects, item: ObjectEstimate | PlacedShape, by: ArrayLike = (0.0, 0.0, 0.0)
) -> Objects:
    """With another object, whose id is the next one.

    Args:
        objects: of the scene.
        item: an object, of another scene or of this one, or a shape and its pose.
        by: where it goes from where it is (m).

    Raises:
        InputError: numbers are wrong.
    """
    label = _next_id(objects)
    if not isinstance(item, PlacedShape | ObjectEstimate):
        raise InputError(
            f"what is added is a {type(item).__name__}; give an object of a scene, such as "
            "scene[1], or a PlacedShape"
        )
    if isinstance(item, PlacedShape):
        (new_item,) = estimate_objects({label: item.mesh()}, {label: 1.0}, {label: item})  # certain
    else:
        new_item = replace(item, id=label)
    shift = rigid(np.eye(3), _vector(by, "the move"))
    return (*objects, _require_reach(moved_object(new_item, shift)))


def joined(objects: Objects, second_objects: Objects, by: ArrayLike = (0.0, 0.0, 0.0)) -> Objects:
    """The objects of two scenes; those of the second one get the next ids.

    Args:
        objects: of the first scene.
        second_objects: of the second scene.
        by: where the second one goes (m).

    Raises:
        InputError: numbers are wrong.
    """
    for item in second_objects:
        objects = added(objects, item, by)
    return objects


def superquadric(
    half_axes: ArrayLike,
    exponents: ArrayLike = (2.0, 2.0, 2.0),
    position: Sequence[float | None] = (0.0, 0.0, None),
    turn: float = 0.0,
) -> PlacedShape:
    """A superquadric that stands somewhere.

    Args:
        half_axes: (3,) m.
        exponents: (3,) r, s, t of equation 5.1: 2 is round, 20 like a block.
        position: (3,) of its centre (m); a height of None puts it on the floor.
        turn: degrees about the vertical.

    Raises:
        InputError: numbers are wrong.
    """
    shape = Superquadric(np.asarray(half_axes, np.float64), np.asarray(exponents, np.float64))
    x, y, z = position if len(position) == 3 else (None,) * 3
    place = _vector((x, y, shape.half_axes[2] if z is None else z), "the position")
    if not np.isfinite(turn):
        raise InputError(f"turn {turn}: expected degrees")
    rotation = Rotation.from_euler("z", turn, degrees=True).as_matrix()
    return PlacedShape(shape, Pose.from_matrix(rigid(rotation, place)))


def with_objects(estimate: SceneEstimate, objects: Objects) -> SceneEstimate:
    """The scene with other objects: its volumes are made of their meshes.

    Vessels have a lid on there, as in predicted volumes: voxels are thicker than walls.
    The grid grows where objects lie outside; its voxels do only beyond twice as many per side.
    What the image shows stays: the frame, obstacles, and the masks of objects that are still there
    with their own shapes.
    Volumes of other representations go, and so do details that are of the prediction alone.

    Args:
        estimate: the scene before.
        objects: of the scene now.
    """
    before = estimate.objects
    if len(objects) == len(before) and all(map(operator.is_, objects, before)):
        return estimate
    grid = _grid_around(estimate.grid, objects)
    tsdf, instances = mesh_volumes([(item.id, _mesh_with_lid(item)) for item in objects], grid)
    masks = estimate.masks
    if masks is not None:
        faces = {item.id: item.mesh.faces for item in before}  # a new object may have an old id
        remaining_ids = [item.id for item in objects if faces.get(item.id) is item.mesh.faces]
        masks = np.where(np.isin(masks, remaining_ids), masks, 0).astype(np.int32)
    details = {key: estimate.details[key] for key in _IMAGE_DETAILS if key in estimate.details}
    details["grid"] = asdict(grid)
    return replace(
        estimate,
        objects=objects,
        grid=grid,
        tsdf=tsdf,
        instances=instances,
        details=details,
        volumes={},
        masks=masks,
    )


def _mesh_with_lid(item: ObjectEstimate) -> TriangleMesh:
    """What a volume holds of an object."""
    if item.placed is None or not isinstance(item.placed.shape, Vessel):
        return item.mesh
    mesh = item.placed.shape.filled_mesh()
    return TriangleMesh(transform_points(item.placed.pose.matrix, mesh.vertices), mesh.faces)


def _grid_around(grid: GridSpec, objects: Objects) -> GridSpec:
    """A grid that holds the old one and all objects."""
    if not objects:
        return grid
    margin = 2 * grid.voxel_size
    low = np.min([item.mesh.vertices.min(axis=0) for item in objects], axis=0) - margin
    high = np.max([item.mesh.vertices.max(axis=0) for item in objects], axis=0) + margin
    lower, upper = np.array(grid.lower), np.array(grid.lower) + grid.extent
    if (low >= lower).all() and (high <= upper).all():
        return grid
    low, high = np.minimum(low, lower), np.maximum(high, upper)
    extent = float((high - low).max())
    low[:2] -= (extent - (high - low)[:2]) / 2
    voxels = min(int(np.ceil(extent / grid.voxel_size)), 2 * grid.resolution)
    return replace(grid, resolution=voxels, extent=extent, lower=tuple(low.tolist()))


def _scaled_shape(placed: PlacedShape, factor: float, centre: Float64) -> PlacedShape | None:
    """A scaled shape; None of a kind that has no size of its own."""
    shape = placed.shape
    larger: Shape
    if isinstance(shape, Vessel):
        larger = shape.scaled(factor)
    elif isinstance(shape, Superquadric | Superellipsoid):
        larger = replace(shape, half_axes=shape.half_axes * factor)
    else:
        return None
    position = centre + factor * (placed.pose.position - centre)
    return PlacedShape(larger, Pose(position, placed.pose.quaternion))


def _in_place_of(place: ObjectEstimate, shape: ObjectEstimate) -> ObjectEstimate:
    """The shape of one object with the id and the pose of another."""
    motion = place.pose.matrix @ np.linalg.inv(shape.pose.matrix)
    replacement = replace(moved_object(shape, motion), id=place.id)
    up = place.mesh.vertices[:, 2].min() - replacement.mesh.vertices[:, 2].min()
    return _require_reach(moved_object(replacement, rigid(np.eye(3), np.array([0.0, 0.0, up]))))


def _replace_object(objects: Objects, changed: ObjectEstimate) -> Objects:
    return tuple(changed if item.id == changed.id else item for item in objects)


def _next_id(objects: Objects) -> int:
    return max((item.id for item in objects), default=0) + 1


def _require_reach(item: ObjectEstimate) -> ObjectEstimate:
    if not (np.abs(item.pose.position) < _MAX_DISTANCE).all():
        raise InputError(
            f"object {item.id} would be {np.abs(item.pose.position).max():.3g} m away; positions "
            "are in metres"
        )
    return item


def _vector(values: Any, quantity: str) -> Float64:
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.full(0, np.nan)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise InputError(f"{quantity} is {values!r}: expected 3 numbers")
    return array
