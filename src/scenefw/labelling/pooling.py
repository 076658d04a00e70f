"""Two experts' probabilities of a vertex made one: a nested logarithmic opinion pool, learnt.

A logarithmic pool multiplies the experts' calibrated distributions (Genest and Zidek 1986;
products of experts, Hinton 2002):

    p(c) ~ u(c) (v(c) / u(c))^a (m(c) / u(c))^b,  v = (1 - e) views + e u,  m = (1 - e) map + e u

where u is uninformative (all classes equally probable) and a and b are inverse temperatures (Guo
et al. 2017): fused views repeat one network's mistakes, so their product is overconfident. Both
slide from one value to another with how well the map is reconstructed around the vertex, since
that is what a network that reads the map depends on. The doubt e bounds the evidence that one
vertex can give.

There is one such pool for whether a vertex belongs to the surface or to an object, and one for
which object it belongs to (nested logit, McFadden 1978), since the experts make their mistakes in
different places: fused views bleed over outlines. With the same weights for both, what is gained
inside objects is lost along their outlines. A bias of the surface makes up for the bleeding.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from scenefw.core.types import Float32

DOUBT = 0.005
_TOLERANCE = 1e-6  # float32 probabilities this close to uninformative count as that


@dataclass(frozen=True)
class Weights:
    """Inverse temperatures of both experts, and a bias of the first class.

    Args:
        views_poor: weight of fused views where the map is poorly reconstructed.
        views_well: the same where it is well reconstructed.
        map_poor: weight of the map's labels where it is poorly reconstructed.
        map_well: the same where it is well reconstructed.
        bias_poor: added to the first class's log-odds where the map is poorly reconstructed.
        bias_well: the same where it is well reconstructed.
    """

    views_poor: float
    views_well: float
    map_poor: float
    map_well: float
    bias_poor: float = 0.0
    bias_well: float = 0.0

    def __post_init__(self) -> None:
        values = astuple(self)
        if not np.isfinite(values).all() or min(values[:4]) < 0:
            raise ConfigError(
                f"{self} can't be used; expected weights of 0 or more and finite biases"
            )


UNCALIBRATED = Weights(views_poor=1.0, views_well=1.0, map_poor=0.0, map_well=1.0)
"""The product of both experts where the map is well reconstructed, the views alone elsewhere."""


@dataclass(frozen=True)
class Pool:
    """Surface or object, then which object; the first class is the surface.

    Args:
        surface: weights of the pool of p(surface) and p(object).
        objects: weights of the pool of p(class | object).
        doubt: share of the uninformative distribution mixed into each one before pooling.
    """

    surface: Weights = UNCALIBRATED
    objects: Weights = UNCALIBRATED
    doubt: float = DOUBT

    def __post_init__(self) -> None:
        check_doubt(self.doubt)

    @property
    def parts(self) -> dict[str, Weights]:
        """Its two pools by name."""
        return {"surface": self.surface, "objects": self.objects}

    def __call__(self, views: Float32, of_map: Float32, well: Float32) -> Float32:
        """Pooled probabilities (C, ...) float32; an expert that is uniform has no influence.

        Args:
            views: (C, ...) of fused views.
            of_map: (C, ...) of the map's labels.
            well: (...) in [0, 1], see `Reconstruction`.
        """
        (views_gate, views_objects), (map_gate, map_objects) = nested(views), nested(of_map)
        unknown, any_object = uninformative_distributions(len(views))
        gate = pool(views_gate, map_gate, well, self.surface, self.doubt, unknown)
        objects = pool(views_objects, map_objects, well, self.objects, self.doubt, any_object)
        objects *= gate[1]
        return np.concatenate([gate[:1], objects])


def check_doubt(doubt: float) -> float:
    """The doubt, or a ConfigError if it is not a share between 0 and 1."""
    if not 0 < doubt < 1:
        raise ConfigError(f"doubt = {doubt}; expected a share between 0 and 1, such as {DOUBT}")
    return doubt


def nested(probabilities: Float32) -> tuple[Float32, Float32]:
    """p(surface) and p(object) (2, ...), and p(class | object) (C - 1, ...)."""
    of_object = probabilities[1:].sum(axis=0)
    objects = np.full_like(probabilities[1:], 1 / max(len(probabilities) - 1, 1))
    np.divide(probabilities[1:], of_object, out=objects, where=of_object > 0)
    return np.stack([probabilities[0], of_object]), objects


def pool(
    views: Float32,
    of_map: Float32,
    well: Float32,
    weights: Weights,
    doubt: float,
    uninformative: Float32,
) -> Float32:
    """Pooled probabilities (C, ...) float32 of one logarithmic pool.

    Args:
        views: (C, ...) of fused views.
        of_map: (C, ...) of the map's labels.
        well: (...) in [0, 1], see `Reconstruction`.
        weights: of the pool.
        doubt: share of `uninformative` mixed into each of the two.
        uninformative: (C,) distribution of an expert without evidence.
    """
    scores = np.zeros_like(views) + _upright(np.log(uninformative), views)
    poor_and_well = np.array(astuple(weights), np.float32).reshape(3, 2)
    amounts = np.tensordot(poor_and_well, ends(well), axes=1)
    features = features_of(views, of_map, doubt, uninformative)
    for amount, feature in zip(amounts, features, strict=True):
        feature *= amount
        scores += feature
    scores -= scores.max(axis=0)
    np.exp(scores, out=scores)
    scores /= scores.sum(axis=0)
    return scores


def disagreement(views: Float32, of_map: Float32, pooled: Float32) -> Sequence[NDArray[np.bool_]]:
    """Where the pooled class (...) is that of the views, and where it is that of the map."""
    winner = pooled.argmax(axis=0)
    return views.argmax(axis=0) == winner, of_map.argmax(axis=0) == winner


def features_of(views: Float32, of_map: Float32, doubt: float, uninformative: Float32) -> Float32:
    """What the weights multiply (3, C, ...): the evidence of views and of the map, and the bias.

    The bias counts only where one of the two is informative, so that vertices without evidence
    stay unknown.
    """
    bias = np.zeros_like(views)
    bias[0] = _is_informative(views, uninformative) | _is_informative(of_map, uninformative)
    evidence = (_evidence(expert, doubt, uninformative) for expert in (views, of_map))
    return np.stack([*evidence, bias])


def ends(well: Float32) -> Float32:
    """Shares (2, ...) of the weights where a map is poorly and where it is well reconstructed."""
    return np.stack([1 - well, well]).astype(np.float32)


def _is_informative(probabilities: Float32, uninformative: Float32) -> NDArray[np.bool_]:
    """(...) where a distribution differs from the uninformative one."""
    differences = np.abs(probabilities - _upright(uninformative, probabilities))
    return np.asarray(differences.max(axis=0) > _TOLERANCE)


def _evidence(probabilities: Float32, doubt: float, uninformative: Float32) -> Float32:
    """Log-ratio of the distribution, mixed with the uninformative one, to the latter."""
    mixed = probabilities * np.float32(1 - doubt) / _upright(uninformative, probabilities)
    mixed += np.float32(doubt)
    return np.log(mixed, out=mixed)


def uninformative_distributions(classes: int) -> tuple[Float32, Float32]:
    """Uninformative distributions of surface or object (2,), and of which object (C - 1,)."""
    kinds = max(classes - 1, 1)
    gate = np.array([1, kinds], np.float32) / np.float32(kinds + 1)
    return gate, np.full(classes - 1, 1 / kinds, np.float32)


def _upright(values: Float32, like: Float32) -> Float32:
    """(C,) as (C, 1, ...), to broadcast against (C, ...)."""
    return values.reshape(-1, *[1] * (like.ndim - 1))
