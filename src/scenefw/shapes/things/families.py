"""All families of things, by name."""

from scenefw.shapes.things import compound, containers, grown, handled, packed
from scenefw.shapes.things.family import Family

FAMILIES: dict[str, Family] = {
    item.name: item
    for module in (containers, handled, packed, grown, compound)
    for item in vars(module).values()
    if isinstance(item, Family)
}
