"""What is tested on was not trained on: scenes and models of the parts of the data."""

from itertools import combinations

import numpy as np
import pytest

from scenefw.core.tabletop import SPLITS
from scenefw.data import stacks
from scenefw.data.stacks import SHIPPED, StackScenes
from scenefw.scenes.tabletop import TabletopGenerator
from scenefw.shapes.tabletop.library import FAMILIES, ProceduralModels


def rows(*arrays):
    """Rows of arrays side by side, as a set that can be compared exactly."""
    return {row.tobytes() for row in np.concatenate([np.float32(a) for a in arrays], axis=1)}


def scenes(name, split):
    found = StackScenes(name, split)
    p = found.parameters(list(range(len(found))))
    flat = (p.positions.flatten(1), p.rotations.flatten(1), p.half_axes.flatten(1))
    return set(found.indices.tolist()), rows(*flat)


def objects(name, split):
    found = StackScenes(name, split)
    p = found.parameters(list(range(len(found))))
    return rows(p.half_axes[p.present].numpy(), p.exponents[p.present].numpy())


@pytest.mark.parametrize("name", SHIPPED)
def test_parts_of_the_shipped_stacks_share_no_scene(name):
    for first, second in combinations([scenes(name, split) for split in stacks.SPLITS], 2):
        for mine, other in zip(first, second, strict=True):
            assert len(mine) > 500
            assert not mine & other


@pytest.mark.xfail(strict=True, reason="all parts draw from one library of 3500 superquadrics")
@pytest.mark.parametrize("name", SHIPPED)
def test_parts_of_the_shipped_stacks_share_no_object(name):
    for first, second in combinations([objects(name, split) for split in stacks.SPLITS], 2):
        assert not first & second


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
