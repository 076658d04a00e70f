"""From one view to a set of superquadrics: queries that start where something is seen."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

from scenefw.core.errors import ConfigError
from scenefw.core.queried_sets import ObjectQueryPrediction, QueriedSet, ViewedSetBatch
from scenefw.kernels.precision import full_precision
from scenefw.models.relative_attention import RelativeAttention
from scenefw.models.view_tokens import Tokens, TrainedEncoder, ViewTokens
from scenefw.shapes.radial_distance import radial_distance

SIZE = 15
"""Numbers of an object: centre 3, two columns of its rotation 6, half-axes 3, exponents 3."""
_OFFSET = 7  # numbers that say where a token lies for a query
_REACH = 0.1  # m, of centres from where queries start, for a number of one
_TYPICAL, _WIDEST = 0.06, 2.0  # m, of half-axes; most by which their logarithms differ from it
_LEAST_EXPONENT, _EXPONENTS = math.log(2), 3.9
_NEAR = 0.05  # m: offsets that differ by this differ clearly
_CLOSE = 0.01  # m: likewise for distances to a surface
_RARE = -1.5  # logit of existence at first
_HIDDEN = (0.1, 0.05)  # m: where queries for hidden objects start: spread, height


class _Queries(NamedTuple):
    """Queries on their way through the layers.

    Args:
        features: (B, N, width).
        starts: (B, N, 3) m, what centres are told from.
        numbers: (B, N, 15), what the layers before have found.
        active: (B, N) bool.
    """

    features: Tensor
    starts: Tensor
    numbers: Tensor
    active: Tensor


class ObjectQueries(nn.Module):
    """Superquadrics with existence scores for a view, by queries that attend to its tokens.

    Tokens are features of a trained network of volumes (`ViewTokens`). Most queries start at seen
    points that are far from each other, some at learnt places, for objects that nobody sees. In
    each layer they look at tokens as these lie from their object, in the world, in its own frame
    and from its surface, and at each other; then they change their object (as Carion et al. 2020
    and Zhu et al. 2021 for boxes). All layers are trained. Centre, half-axes and exponents are
    bounded softly.

    Args:
        encoder: a trained `shape_instance_vae`, whose encoder of views is taken.
        seeded: queries at seen points, at most.
        free: queries at learnt places.
        tokens: seen points that are looked at, at most.
        width: channels.
        layers: of the decoder.
        view_layers: of attention among tokens.
        heads: of attention.
        frozen: leave the encoder as it is trained.

    Raises:
        ConfigError: a number below one, more seeds than tokens, or channels that heads can't share.
    """

    training_only: Sequence[str] = ()

    def __init__(
        self,
        encoder: TrainedEncoder | Mapping[str, Any],
        seeded: int = 16,
        free: int = 4,
        tokens: int = 192,
        width: int = 128,
        layers: int = 4,
        view_layers: int = 2,
        heads: int = 4,
        *,
        frozen: bool = True,
    ) -> None:
        super().__init__()
        sizes = {
            "seeded": seeded, "free": free, "tokens": tokens, "width": width, "layers": layers,
            "view_layers": view_layers, "heads": heads,
        }  # fmt: skip
        _check(sizes)
        self.view = ViewTokens(encoder, tokens, width, view_layers, heads, frozen=frozen)
        self.recipe = {
            "_target_": f"{__name__}.ObjectQueries",
            "encoder": self.view.sizes,
            **sizes,
            "frozen": frozen,
        }
        self.grid = self.view.grid
        self.seeded, self.queries = seeded, seeded + free
        self.seed = nn.Parameter(0.02 * torch.randn(width))
        self.free = nn.Parameter(0.02 * torch.randn(free, width))
        spread, height = _HIDDEN
        starts = spread * torch.randn(free, 3)
        self.starts = nn.Parameter(torch.cat([starts[:, :2], starts[:, 2:].abs() + height], dim=-1))
        self.layers = nn.ModuleList([_Layer(width, heads) for _ in range(layers)])

    def forward(self, batch: ViewedSetBatch) -> ObjectQueryPrediction:
        """Training pass: a set of each layer."""
        return ObjectQueryPrediction(self._sets(batch.condition, batch.points, batch.seen))

    def predict(self, condition: Tensor, points: Tensor, seen: Tensor) -> QueriedSet:
        """The set of the last layer.

        Args:
            condition: (B, 2, X, Y, Z), distances in units of the truncation.
            points: (B, P, 3) m, world, of what is seen above the floor.
            seen: (B, P) bool: points that count.
        """
        return self._sets(condition, points, seen)[-1]

    def _sets(self, condition: Tensor, points: Tensor, seen: Tensor) -> list[QueriedSet]:
        tokens = self.view(condition, points, seen)
        queries = self._first(tokens)
        found = []
        for layer in self.layers:
            now = bounded(queries)
            placed = self.view.placed(now.positions)
            features, change, existence = layer(queries, now, tokens, placed)
            queries = queries._replace(features=features, numbers=queries.numbers + change)
            found.append(bounded(queries, existence))
            queries = queries._replace(numbers=queries.numbers.detach())
        return found

    def _first(self, tokens: Tokens) -> _Queries:
        """Queries before the first layer: balls of typical size where they start."""
        batch = len(tokens.places)
        starts = torch.cat(
            [tokens.places[:, : self.seeded], self.starts.expand(batch, -1, -1)], dim=1
        )
        features = torch.cat(
            [tokens.features[:, : self.seeded] + self.seed, self.free.expand(batch, -1, -1)], dim=1
        )
        always = tokens.counted.new_ones(batch, len(self.free))
        active = torch.cat([tokens.counted[:, : self.seeded], always], dim=1)
        return _Queries(features, starts, starts.new_zeros(*starts.shape[:2], SIZE), active)


class _Layer(nn.Module):
    """Looks at the view, then at the other queries, and says what changes.

    Args:
        width: channels.
        heads: of attention.
    """

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.look = RelativeAttention(width, heads, _OFFSET)
        self.talk = RelativeAttention(width, heads, _OFFSET)
        self.norms = nn.ModuleList([nn.LayerNorm(width) for _ in range(4)])
        self.own = nn.Linear(SIZE, width)
        self.deep = nn.Sequential(
            nn.Linear(width, 3 * width), nn.GELU(), nn.Linear(3 * width, width)
        )
        self.head = nn.Sequential(nn.Linear(width, width), nn.GELU())
        self.change, self.existence = nn.Linear(width, SIZE), nn.Linear(width, 1)
        nn.init.normal_(self.change.weight, std=1e-3)
        nn.init.zeros_(self.change.bias)
        nn.init.constant_(self.existence.bias, _RARE)

    def forward(
        self, queries: _Queries, now: QueriedSet, tokens: Tokens, placed: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Features (B, N, width), changes of numbers (B, N, 15), logits of existence (B, N).

        Args:
            queries: before this layer.
            now: their objects.
            tokens: of the view.
            placed: (B, N, width), where their objects are.
        """
        about = placed + self.own(queries.numbers)
        features = queries.features
        asked = self.norms[0](features) + about
        offsets = seen_from(now, tokens.places)
        features = features + self.look(asked, tokens.features, offsets, tokens.counted)
        asked = self.norms[1](features) + about
        offsets = seen_from(now, now.positions)
        features = features + self.talk(asked, asked, offsets, queries.active)
        features = features + self.deep(self.norms[2](features))
        told = self.head(self.norms[3](features))
        return features, self.change(told).float(), self.existence(told)[..., 0].float()


def bounded(queries: _Queries, existence: Tensor | None = None) -> QueriedSet:
    """The objects of queries, bounded softly: any numbers make a solid.

    Args:
        queries: of which numbers and starts count.
        existence: (B, N) logits; None: none are known yet.
    """
    numbers = queries.numbers
    first = nn.functional.normalize(numbers[..., 3:6] + numbers.new_tensor([1.0, 0, 0]), dim=-1)
    second = numbers[..., 6:9] + numbers.new_tensor([0, 1.0, 0])
    second = second - (first * second).sum(dim=-1, keepdim=True) * first
    second = nn.functional.normalize(second, dim=-1)
    wide = _WIDEST * (numbers[..., 9:12] / _WIDEST).tanh()
    return QueriedSet(
        numbers[..., 0] if existence is None else existence,
        _TYPICAL * wide.exp(),
        (_LEAST_EXPONENT + _EXPONENTS * numbers[..., 12:15].sigmoid()).exp(),
        torch.stack([first, second, torch.linalg.cross(first, second)], dim=-1),
        queries.starts + _REACH * numbers[..., :3],
        queries.active,
        queries.starts,
    )


@torch.no_grad()
@full_precision()
def seen_from(objects: QueriedSet, places: Tensor) -> Tensor:
    """Where places (B, T, 3) lie for each object: offsets (B, N, T, 7), bounded softly.

    In the world, in the object's frame in units of its half-axes, and the distance to its surface.
    """
    away = (places[:, None] - objects.positions[:, :, None]).float()
    local = away @ objects.rotations.float()
    half_axes, exponents = objects.half_axes[:, :, None], objects.exponents[:, :, None]
    beyond = radial_distance(local, half_axes.expand_as(local), exponents.expand_as(local))
    offsets = torch.cat([away / _NEAR, local / half_axes, beyond[..., None] / _CLOSE], dim=-1)
    return offsets / (1 + offsets.abs() / 3)


def _check(sizes: Mapping[str, int]) -> None:
    words = ", ".join(f"{name} {value}" for name, value in sizes.items())
    if min(sizes.values()) < 1:
        raise ConfigError(f"object_queries has {words}; expected 1 or more of each")
    if sizes["seeded"] > sizes["tokens"]:
        raise ConfigError(f"object_queries has {words}; expected as many tokens as seeds, or more")
    if sizes["width"] % sizes["heads"]:
        raise ConfigError(f"object_queries has {words}; expected a width that heads divide")
