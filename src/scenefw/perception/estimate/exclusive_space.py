"""Space that two objects of a scene fill goes to the surer one."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.types import TriangleMesh
from scenefw.core.weak_cache import cached_by_identity
from scenefw.perception.estimate.contacts import Overlap, overlaps
from scenefw.perception.estimate.objects import estimate_objects

if TYPE_CHECKING:
    from collections.abc import Sequence

    from manifold3d import Manifold

    from scenefw.core.types import ObjectEstimate


def exclusive(objects: Sequence[ObjectEstimate]) -> tuple[ObjectEstimate, ...]:
    """Objects that run neither into each other nor into the floor z = 0, but for touching.

    The one with the higher confidence keeps what two of them fill. Of the other the largest piece
    that is left stays, as a mesh that no shape explains; if nothing is left, it stays as it is.

    Args:
        objects: closed meshes, world coordinates (m), with confidences.
    """
    rivals: defaultdict[int, set[int]] = defaultdict(set)
    for overlap in overlaps(objects):
        rivals[overlap.first].add(overlap.second)
        rivals[overlap.second].add(overlap.first)
    if not rivals:
        return tuple(objects)
    solids: dict[int, Manifold] = {}
    changed: dict[int, ObjectEstimate] = {}
    for item in sorted(objects, key=lambda item: item.confidence, reverse=True):
        if item.id not in rivals:
            continue
        solid = remainder = _solid(item.mesh)
        if Overlap.FLOOR in rivals[item.id]:
            remainder = remainder.trim_by_plane((0.0, 0.0, 1.0), 0.0)
        for rival in sorted(rivals[item.id] & solids.keys()):
            remainder -= solids[rival]
        pieces = remainder.decompose()
        if remainder is solid or not pieces:
            solids[item.id] = solid
            continue
        solids[item.id] = max(pieces, key=lambda piece: piece.volume())
        mesh = _mesh(solids[item.id])
        (estimate,) = estimate_objects({item.id: mesh}, {item.id: item.confidence})
        changed[item.id] = replace(estimate, cues=item.cues)
    return tuple(changed.get(item.id, item) for item in objects)


@cached_by_identity
def _solid(mesh: TriangleMesh) -> Manifold:
    """As the library has it (github.com/elalish/manifold); empty if the surface is not closed."""
    from manifold3d import Manifold, Mesh64

    return Manifold(
        Mesh64(
            np.ascontiguousarray(mesh.vertices, np.float64),
            np.ascontiguousarray(mesh.faces, np.uint64),
        )
    )


def _mesh(solid: Manifold) -> TriangleMesh:
    mesh = solid.to_mesh64()
    return TriangleMesh(
        np.array(mesh.vert_properties[:, :3], np.float64), np.array(mesh.tri_verts, np.int64)
    )
