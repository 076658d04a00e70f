"""Scenes of known superquadrics and boxes, to edit."""

import numpy as np
import trimesh

from scenefw.core.geometry import look_at
from scenefw.core.types import (
    Camera,
    Frame,
    GridSpec,
    PlacedShape,
    Pose,
    SceneEstimate,
    TriangleMesh,
)
from scenefw.perception.estimate.objects import estimate_objects
from scenefw.shapes.superquadric import Superquadric
from scenefw_editing.scene_editing import with_objects

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
CAMERA = Camera(
    64, 48, 58.0, 58.0, 31.5, 23.5, look_at(np.array([0.0, -0.9, 0.6]), np.array([0.0, 0.0, 0.1]))
)


def block(size, position):
    """A nearly sharp block of this full size."""
    shape = Superquadric(np.array(size) / 2, np.full(3, 60.0))
    return PlacedShape(shape, Pose(np.array(position, dtype=np.float64), UPRIGHT))


def box(size, position):
    """A sharp box of twelve triangles."""
    made = trimesh.creation.box(size)
    return TriangleMesh(np.array(made.vertices) + position, np.array(made.faces))


def scene():
    """1, a block on the floor; 2, one on it; 3, a box beside them, a mesh without a shape."""
    placed = {1: block((0.2, 0.16, 0.1), (0, 0, 0.05)), 2: block((0.1, 0.08, 0.06), (0, 0, 0.13))}
    meshes = {label: one.mesh() for label, one in placed.items()}
    meshes[3] = box((0.06, 0.04, 0.08), (0.25, 0.0, 0.04))
    grid = GridSpec(resolution=32)
    empty = np.full(grid.shape, grid.truncation, np.float32)
    masks = np.zeros((48, 64), np.int32)
    masks[20:30, 20:30], masks[10:20, 20:30], masks[20:30, 40:45] = 1, 2, 3
    frame = Frame(np.zeros((48, 64), np.float32), CAMERA, name="blocks")
    details = {"seed": 0, "warnings": ["a line"], "volumes": 1}
    objects = estimate_objects(meshes, {1: 0.9, 2: 0.8, 3: 0.7}, placed)
    none = SceneEstimate((), grid, empty, empty.astype(np.int32), frame, details, {}, masks)
    made = with_objects(none, objects)
    return SceneEstimate(
        made.objects, grid, made.tsdf, made.instances, frame, details, {"flow": empty}, masks
    )
