"""Scenes of things as triangles with looks, for renderers."""

from __future__ import annotations

import numpy as np

from scenefw.core import rng as streams
from scenefw.core.tabletop import PLACEMENT, TabletopGeometry
from scenefw.core.types import Camera
from scenefw_tabletops.scenes import desk_light
from scenefw_things.scenes.painted import paint_count, textured
from scenefw_things.scenes.scene import ThingScene
from scenefw_things.shapes.surface import looks


def geometry(scene: ThingScene) -> TabletopGeometry:
    """All triangles of a scene, lifted so that its floor is z = 0; labels are those of items."""
    rng = streams.generator(scene.light)
    ground = desk_light.surface(rng)
    lights, ambient = desk_light.lamps(rng)
    meshes = []
    for item in scene.items:
        drawn = looks(streams.generator(item.paint), paint_count(item.thing.parts))
        meshes.append(textured(item.thing.parts, drawn))
    corners, normals, placements = [], [], []
    for item, mesh in zip(scene.items, meshes, strict=True):
        turn, place = item.pose.rotation, item.pose.position - (0, 0, scene.floor)
        corners.append((mesh.vertices @ turn.T + place)[mesh.faces])
        normals.append(mesh.normals @ turn.T)
        placements.append([*place, *turn.ravel(), 1.0])
    counts = [len(mesh.faces) for mesh in meshes]
    first = 1 + np.cumsum([0, *(len(mesh.textures) for mesh in meshes)])
    rows = [mesh.texture_of + row for mesh, row in zip(meshes, first, strict=False)]
    textures = [mesh.textures for mesh in meshes]
    return TabletopGeometry(
        np.concatenate(corners).astype(np.float32),
        np.concatenate(normals).astype(np.float32),
        np.concatenate([mesh.colours for mesh in meshes]).astype(np.float32),
        np.concatenate(rows).astype(np.int32),
        np.repeat(np.arange(len(meshes), dtype=np.int32), counts),
        np.arange(1, len(meshes) + 1, dtype=np.int32),
        np.array(placements, dtype=np.float32).reshape(-1, PLACEMENT),
        np.concatenate([[ground.texture()], *textures]).astype(np.float32),
        np.array(ground.colour, dtype=np.float32),
        np.array(
            [
                [*lamp.position[:2], lamp.position[2] - scene.floor, *lamp.intensity]
                for lamp in lights
            ],
            dtype=np.float32,
        ),
        np.array(ambient, dtype=np.float32),
        ("background", *(item.thing.family for item in scene.items)),
        f"things/{scene.seed}/{scene.index}",
    )


def lifted(camera: Camera, scene: ThingScene) -> Camera:
    """A camera of the scene's world in the frame of its triangles."""
    pose = np.array(camera.T_world_camera)
    pose[2, 3] -= scene.floor
    return camera.moved(pose)
