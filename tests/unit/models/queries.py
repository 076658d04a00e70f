"""A small decoder of sets, its encoder, and views made by hand."""

from dataclasses import dataclass, replace

import torch
from tests.unit.learning.tiny import network

from scenefw.core.batches import SceneParameters
from scenefw.core.queried_sets import ObjectQueryBatch
from scenefw.core.types import GridSpec
from scenefw.kernels.place_images import CELL, CHANNELS
from scenefw.models.object_queries import ObjectQueries
from scenefw.models.shape_instance_vae import ShapeInstanceVAE
from scenefw.shapes.radial_distance import in_frame, radial_distance

RESOLUTION = 16
SIZES = {"seeded": 4, "free": 2, "tokens": 12, "width": 32, "layers": 2, "view_layers": 1}


@dataclass
class Encoder:
    """As a loaded checkpoint of a network of volumes."""

    model: ShapeInstanceVAE
    grid: GridSpec
    recipe: dict


def encoder(resolution=RESOLUTION):
    model = network(resolution)
    return Encoder(model, GridSpec(resolution), dict(model.recipe))


def queries(seed=0, **changed):
    torch.manual_seed(seed)
    return ObjectQueries(encoder(), **{**SIZES, "heads": 2, **changed})


def image_queries(seed=0, **changed):
    """One that sees images, whose places are the points of `image_batch_of`."""
    torch.manual_seed(seed)
    sizes = {"sees": "image", "widths": [8, 8, 16, 16]}
    return ObjectQueries(sizes, **{**SIZES, "heads": 2, **changed})


def image_batch_of(views=2, objects=3, seed=0, size=(32, 64)):
    """The views of `batch_of` with any image: one point for each of its cells."""
    cells = size[0] * size[1] // CELL**2
    made = batch_of(views, objects, seed)
    chosen = torch.linspace(0, made.points.shape[1] - 1, cells).long()
    image = torch.randn(views, CHANNELS, *size, generator=torch.Generator().manual_seed(seed))
    return replace(made, condition=image, points=made.points[:, chosen], seen=made.seen[:, chosen])


def scenes_of(views=2, objects=3, seed=0):
    """Turned boxes side by side; the first view has one less."""
    random = torch.Generator().manual_seed(seed)

    def uniform(*shape):
        return torch.rand(views, objects, *shape, generator=random)

    turns = torch.linalg.qr(uniform(3, 3) - 0.5)[0]
    turns = turns * torch.linalg.det(turns)[..., None, None]
    positions = 0.1 * (uniform(3) - 0.5) + torch.tensor([0.0, 0.0, 0.1])
    positions[..., 0] += 0.2 * (torch.arange(objects) - 1)
    present = torch.ones(views, objects, dtype=torch.bool)
    present[0, -1] = False
    return SceneParameters(0.03 + 0.05 * uniform(3), 2 + 10 * uniform(3), turns, positions, present)


def batch_of(views=2, objects=3, seed=0, places=64):
    """Views whose points lie on the objects, with any volume."""
    random = torch.Generator().manual_seed(seed)
    scenes = scenes_of(views, objects, seed)
    about = 0.15 * (torch.rand(views, objects, places, 3, generator=random) - 0.5)
    spots = about + scenes.positions[:, :, None]
    local = in_frame(spots, scenes.rotations, scenes.positions)
    axes, exponents = (
        one[:, :, None].expand_as(local) for one in (scenes.half_axes, scenes.exponents)
    )
    distances = radial_distance(local, axes, exponents)
    surface = local * (1 - distances / local.norm(dim=-1))[..., None]
    points = surface @ scenes.rotations.transpose(-1, -2) + scenes.positions[:, :, None]
    seen = scenes.present[:, :, None].expand(-1, -1, places).flatten(1)
    volume = torch.rand(views, 2, *(RESOLUTION,) * 3, generator=random) * 2 - 1
    return ObjectQueryBatch(volume, points.flatten(1, 2), seen, scenes, spots, distances)
