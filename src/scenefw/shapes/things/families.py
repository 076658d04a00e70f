"""All families of things, by name."""

from scenefw.shapes.things import bullet, compound, containers, grown, handled, packed
from scenefw.shapes.things.family import Family

FAMILIES: dict[str, Family] = {
    item.name: item
    for module in (containers, handled, packed, grown, compound, bullet)
    for item in vars(module).values()
    if isinstance(item, Family)
}
