"""All families of things, and of what is none, by name."""

from types import ModuleType

from scenefw_things.shapes import (
    bullet,
    compound,
    containers,
    free_forms,
    grown,
    handled,
    obstacles,
    packed,
    robots,
)
from scenefw_things.shapes.family import Family


def _families(*modules: ModuleType) -> dict[str, Family]:
    items = [item for module in modules for item in vars(module).values()]
    return {item.name: item for item in items if isinstance(item, Family)}


FAMILIES = _families(containers, handled, packed, grown, free_forms, compound, bullet)
"""Things."""

OBSTACLES = _families(obstacles, robots)
"""What is no thing: furniture, walls, people, machines."""
