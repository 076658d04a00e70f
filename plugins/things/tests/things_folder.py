"""Folders of images of things, rendered small, with their solids."""

from scenefw.core.types import Pose
from scenefw_things.images.renderer import ThingRenderer
from scenefw_things.render import RenderThings
from scenefw_things.scenes.cameras import HandheldCameras
from scenefw_things.scenes.scene import OBJECT, OBSTACLE, ThingItem, ThingScene, save_scenes
from scenefw_things.shapes.families import FAMILIES, OBSTACLES
from scenefw_things.shapes.thing import Thing

SIZE = (96, 72)


def item(families, name, position, role, seed):
    """A thing of middle size."""
    middle = tuple(sum(limits) / 2 for limits in families[name].limits.values())
    return ThingItem(Thing(name, middle, seed), Pose(position, [1.0, 0, 0, 0]), role, seed)


def scene(index, split):
    """A crate, and before it a bowl and a can, side by side."""
    items = (
        item(OBSTACLES, "crate", (0.0, 0.4, 0.0), OBSTACLE, 3),
        item(FAMILIES, "bowl", (0.0, 0.0, 0.0), OBJECT, 1),
        item(FAMILIES, "can", (0.16, -0.02, 0.0), OBJECT, 2),
    )
    return ThingScene(items, 0.0, 5, index, 0, split)


def write_things(folder, views=2):
    """Images of two training scenes and of a validation scene; returns the folder."""
    scenes = [scene(0, "train"), scene(1, "train"), scene(2, "val")]
    path = save_scenes(folder / "things.npz", scenes)
    cameras = HandheldCameras(
        distances=(0.6, 0.8), elevations=(40, 60), fields=(60, 70), sizes=[SIZE], upright=1.0
    )
    RenderThings(path, cameras, ThingRenderer(contrast=1.0), views, 0, folder).run()
    return folder
