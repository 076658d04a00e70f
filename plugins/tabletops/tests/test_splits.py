"""What is tested on was not trained on: models of the parts of the data."""

from itertools import combinations

import pytest

from scenefw.core.tabletop import SPLITS
from scenefw_tabletops.scenes.tabletop import TabletopGenerator
from scenefw_tabletops.shapes.tabletop.library import FAMILIES, ProceduralModels


def test_models_on_tables_are_those_of_the_part():
    models = ProceduralModels()
    generator = TabletopGenerator(models)
    for split in SPLITS:
        for number in generator.numbers(split)[:5]:
            items = generator.generate(number, 0).items
            assert items
            assert all(item.instance in models.instances(item.label, split) for item in items)


def look(family, model):
    """The shape; of bricks, which come in a dozen standard sizes, colour and texture too."""
    parts = [model.vertices.round(6)]
    if family == "brick":
        parts += [model.colours, model.textures]
    return b"".join(part.tobytes() for part in parts)


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_parts_share_no_model_of_tables(family):
    """Neither its number nor its shape."""
    models = ProceduralModels(("surface", family))
    numbers = [models.instances(1, split) for split in SPLITS]
    shapes = [{look(family, models.model(1, i)) for i in part} for part in numbers]
    for first, second in (*combinations(map(set, numbers), 2), *combinations(shapes, 2)):
        assert first
        assert not first & second
