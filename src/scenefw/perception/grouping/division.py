"""Parts of an image joined to objects, and divided, by the instances of a network."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from scenefw.core.errors import ConfigError
from scenefw.core.settings import SHARE
from scenefw.perception.segmentation.regions import along_borders, grown

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float32, Int32
    from scenefw.perception.evidence.gathering import View


class GroupedByNetwork:
    """Joins and divides parts as a network says, which knows what belongs together behind others.

    - Parts of one instance are one object if they don't touch in the image (what hides a third of
      an object leaves two parts of it), or if one is a fragment of the other.
    - A part of which several instances have a large share is divided among them.

    Args:
        share: of a part's pixels that must show an instance for the part to be its.
        fragment: a part this much smaller than another of its instance joins it.
        divided: share of a part's pixels from which on an instance is an object in it.
        border: parts with a longer common border touch (pixels).

    Raises:
        ConfigError: shares outside 0..1, or a border that isn't positive.
    """

    def __init__(
        self, share: float = 0.6, fragment: float = 0.15, divided: float = 0.3, border: int = 25
    ) -> None:
        SHARE.require(share=share, fragment=fragment, divided=divided)
        if border < 1:
            raise ConfigError(f"border is {border}; expected a positive number of pixels")
        self.share, self.fragment, self.divided, self.border = share, fragment, divided, border

    def objects(self, parts: Int32, view: View, depth: Float32) -> Int32:
        """Objects (H, W), 0 = none, of parts (H, W) and a view whose masks are the network's."""
        return divide(self.join(parts, view.masks), view.masks, self.divided, depth)

    def join(self, parts: Int32, shown: Int32) -> Int32:
        """Parts (H, W) joined to objects, 0 = none, by the instances (H, W) that they show."""
        sizes, main = np.bincount(parts.ravel()), shown_instances(parts, shown, self.share)
        _, lengths = along_borders(parts, parts[:, 1:], parts[1:])
        touching = lengths >= self.border
        same = [
            (a, b)
            for a, b in combinations(np.flatnonzero(main), 2)
            if main[a] == main[b]
            and (not touching[a, b] or _ratio(sizes[a], sizes[b]) < self.fragment)
        ]
        links = coo_matrix((np.ones(len(same)), np.reshape(same, (-1, 2)).T), lengths.shape)
        joined = connected_components(links, directed=False)[1]
        return np.searchsorted(np.unique(joined), joined)[parts].astype(np.int32)


def shown_instances(parts: Int32, shown: Int32, share: float) -> NDArray[np.int64]:
    """The instance that a share of each part's pixels show (P + 1,), 0 = none."""
    main = np.zeros(int(parts.max(initial=0)) + 1, np.int64)
    for part in range(1, len(main)):
        votes = np.bincount(shown[parts == part], minlength=1)
        whole, votes[0] = votes.sum(), 0
        if whole and votes.max() >= share * whole:
            main[part] = votes.argmax()
    return main


def divide(objects: Int32, shown: Int32, share: float, depth: Float32) -> Int32:
    """Objects (H, W) of which several instances (H, W) have a large share become several.

    Args:
        objects: labels, 0 = none.
        shown: instance that a pixel shows, 0 = none.
        share: of an object's pixels from which on an instance is large.
        depth: (H, W) metres.
    """
    found, unused = objects.copy(), int(objects.max(initial=0)) + 1
    for label in range(1, unused):
        own = objects == label
        votes = np.bincount(shown[own], minlength=1)
        votes[0] = 0
        large = np.flatnonzero(votes >= max(share * own.sum(), 1))
        if len(large) < 2:
            continue
        pieces = np.zeros_like(objects)
        for number, instance in enumerate(large[1:], start=unused):
            pieces[own & (shown == instance)] = number
        pieces[own & (shown == large[0])] = label
        found[own] = grown(pieces, own, depth)[own]
        found[own & (found == 0)] = label
        unused += len(large) - 1
    return found


def _ratio(first: int, second: int) -> float:
    return min(first, second) / max(first, second)
