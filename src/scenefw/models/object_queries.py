"""From one view to a set of superquadrics: queries that start where something is seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

from scenefw.core.errors import ConfigError
from scenefw.core.queried_sets import (
    VOLUME,
    ObjectQueryBatch,
    ObjectQueryPrediction,
    QueriedSet,
)
from scenefw.core.settings import NOT_NEGATIVE
from scenefw.core.training_protocols import TrainedOnGrid
from scenefw.kernels.precision import full_precision
from scenefw.models.query_numbers import SIZE, Noised, noised, parameters_of
from scenefw.models.relative_attention import RelativeAttention
from scenefw.models.view_encoders import encoder_of
from scenefw.models.view_tokens import Tokens
from scenefw.shapes.radial_distance import radial_distance

_OFFSET = 7  # numbers that say where a token lies for a query
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

    Tokens are features of a trained network of volumes (`ViewTokens`), or of an encoder of images
    that learns with the rest (`ImageTokens`). Most queries start at seen points that are far from
    each other, some at learnt places, for objects that nobody sees. In each layer they look at
    tokens as these lie from their object, in the world, in its own frame and from its surface, and
    at each other; then they change their object (as Carion et al. 2020 and Zhu et al. 2021 for
    boxes). All layers are trained. Centre, half-axes and exponents are bounded softly.

    With `denoised`, denoising queries of a training start near true objects, which they have to
    find (Li et al. 2022), or farther away, where they have to say that nothing is there (Zhang et
    al. 2023). They need no matching. Each group, one of both kinds for each object, sees the view
    and itself alone. In losses, sets of denoising queries weigh as much as the others.

    Args:
        encoder: a trained `shape_instance_vae`, whose encoder of views is taken; or the sizes of
            an encoder of images (`sees: image`).
        seeded: queries at seen points, at most.
        free: queries at learnt places.
        tokens: seen points that are looked at, at most.
        width: channels.
        layers: of the decoder.
        view_layers: of attention among tokens.
        heads: of attention.
        denoised: groups of denoising queries, in training.
        frozen: leave a trained encoder as it is; one of images always learns.

    Raises:
        ConfigError: a number below one, more seeds than tokens, or channels that heads can't share.
    """

    training_only: Sequence[str] = ()

    def __init__(
        self,
        encoder: TrainedOnGrid[nn.Module] | Mapping[str, Any],
        seeded: int = 16,
        free: int = 4,
        tokens: int = 192,
        width: int = 128,
        layers: int = 4,
        view_layers: int = 2,
        heads: int = 4,
        denoised: int = 0,
        *,
        frozen: bool = True,
    ) -> None:
        super().__init__()
        sizes = {
            "seeded": seeded, "free": free, "tokens": tokens, "width": width, "layers": layers,
            "view_layers": view_layers, "heads": heads,
        }  # fmt: skip
        _check(sizes)
        NOT_NEGATIVE.require(denoised=denoised)
        self.view = encoder_of(encoder, tokens, width, view_layers, heads, frozen=frozen)
        self.recipe = {
            "_target_": f"{__name__}.ObjectQueries",
            "encoder": self.view.sizes,
            **sizes,
            "denoised": denoised,
            **({"frozen": frozen} if self.view.sees == VOLUME else {}),
        }
        self.grid, self.sees = self.view.grid, self.view.sees
        self.seeded, self.queries, self.denoised = seeded, seeded + free, denoised
        self.seed = nn.Parameter(0.02 * torch.randn(width))
        self.free = nn.Parameter(0.02 * torch.randn(free, width))
        if denoised:
            self.noised = nn.Parameter(0.02 * torch.randn(width))
        spread, height = _HIDDEN
        starts = spread * torch.randn(free, 3)
        self.starts = nn.Parameter(torch.cat([starts[:, :2], starts[:, 2:].abs() + height], dim=-1))
        self.layers = nn.ModuleList([_Layer(width, heads) for _ in range(layers)])

    def forward(
        self, batch: ObjectQueryBatch, generator: torch.Generator | None = None
    ) -> ObjectQueryPrediction:
        """Training pass: a set of each layer.

        Args:
            batch: views and objects.
            generator: of the noise of denoising queries, on the CPU; None: without these.
        """
        tokens = self.view(batch.condition, batch.points, batch.seen)
        layers = self._sets(self._first(tokens), tokens)
        if generator is None or not self.denoised:
            return ObjectQueryPrediction(layers)
        start = noised(batch.scenes, self.denoised, generator)
        groups = Tokens(*(values.repeat_interleave(self.denoised, dim=0) for values in tokens))
        denoised_sets = self._sets(self._near_truth(start), groups)
        return ObjectQueryPrediction(
            layers,
            [_of_views(queried_set, start, len(batch.points)) for queried_set in denoised_sets],
        )

    def predict(self, condition: Tensor, points: Tensor, seen: Tensor) -> QueriedSet:
        """The set of the last layer.

        Args:
            condition: what the encoder sees, as in `ObjectQueryBatch`.
            points: (B, P, 3) m, of what is seen above the floor.
            seen: (B, P) bool: points that count.
        """
        tokens = self.view(condition, points, seen)
        return self._sets(self._first(tokens), tokens)[-1]

    def _sets(self, queries: _Queries, tokens: Tokens) -> list[QueriedSet]:
        sets = []
        for layer in self.layers:
            now = bounded(queries)
            placed = self.view.placed(now.positions)
            features, change, existence = layer(queries, now, tokens, placed)
            queries = queries._replace(features=features, numbers=queries.numbers + change)
            sets.append(bounded(queries, existence))
            queries = queries._replace(numbers=queries.numbers.detach())
        return sets

    def _near_truth(self, start: Noised) -> _Queries:
        """Queries that start at objects with noise."""
        features = self.noised.expand(*start.starts.shape[:2], -1)
        return _Queries(features, start.starts, start.numbers, start.active)

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
        query = self.norms[0](features) + about
        offsets = seen_from(now, tokens.places)
        features = features + self.look(query, tokens.features, offsets, tokens.counted)
        query = self.norms[1](features) + about
        offsets = seen_from(now, now.positions)
        nobody = ~queries.active.any(dim=1, keepdim=True)  # softmax needs some that count
        features = features + self.talk(query, query, offsets, queries.active | nobody)
        features = features + self.deep(self.norms[2](features))
        last = self.head(self.norms[3](features))
        return features, self.change(last).float(), self.existence(last)[..., 0].float()


def bounded(queries: _Queries, existence: Tensor | None = None) -> QueriedSet:
    """The objects of queries, bounded softly: any numbers make a solid.

    Args:
        queries: of which numbers and starts count.
        existence: (B, N) logits; None: none are known yet.
    """
    positions, rotations, half_axes, exponents = parameters_of(queries.numbers, queries.starts)
    return QueriedSet(
        queries.numbers[..., 0] if existence is None else existence,
        half_axes,
        exponents,
        rotations,
        positions,
        queries.active,
        queries.starts,
    )


def _of_views(queried_set: QueriedSet, start: Noised, views: int) -> QueriedSet:
    """Groups of denoising queries, several for a view, as one matched set for each view."""

    def merge(values: Tensor) -> Tensor:
        return values.unflatten(0, (views, -1)).flatten(1, 2)

    return QueriedSet(
        merge(queried_set.existence), merge(queried_set.half_axes), merge(queried_set.exponents),
        merge(queried_set.rotations), merge(queried_set.positions), merge(queried_set.active),
        merge(queried_set.starts), matched=merge(start.objects),
    )  # fmt: skip


@torch.no_grad()
@full_precision()
def seen_from(objects: QueriedSet, places: Tensor) -> Tensor:
    """Where places (B, T, 3) lie for each object: offsets (B, N, T, 7), bounded softly.

    In the world, in the object's frame in units of its half-axes, and the distance to its surface.
    """
    displacements = (places[:, None] - objects.positions[:, :, None]).float()
    local = displacements @ objects.rotations.float()
    half_axes, exponents = objects.half_axes[:, :, None], objects.exponents[:, :, None]
    distances = radial_distance(local, half_axes.expand_as(local), exponents.expand_as(local))
    offsets = torch.cat(
        [displacements / _NEAR, local / half_axes, distances[..., None] / _CLOSE], dim=-1
    )
    return offsets / (1 + offsets.abs() / 3)


def _check(sizes: Mapping[str, int]) -> None:
    words = ", ".join(f"{name} {value}" for name, value in sizes.items())
    if min(sizes.values()) < 1:
        raise ConfigError(f"object_queries has {words}; expected 1 or more of each")
    if sizes["seeded"] > sizes["tokens"]:
        raise ConfigError(f"object_queries has {words}; expected as many tokens as seeds, or more")
    if sizes["width"] % sizes["heads"]:
        raise ConfigError(f"object_queries has {words}; expected a width that heads divide")
