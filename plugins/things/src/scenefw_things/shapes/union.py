"""The surface of a union of convex solids, closed, without what lies inside.

Each facet loses what other solids cover, by cutting it along their planes; what is left of all
facets covers the boundary of the union once. Corners that lie on a longer edge of a neighbour are
added to it, so that edges meet edges.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, cKDTree

from scenefw.core.errors import InputError
from scenefw.core.types import Float64, TriangleMesh
from scenefw.shapes.solid_mesh import closed

_TOLERANCES = (1e-12, 1e-11, 1e-13, 1e-10, 1e-9)
"""m: corners so near to a plane lie in it, tried one after the other; rounding moves by 1e-16 m."""

_SAME_CORNER = 100  # tolerances: cuts computed twice differ by less if planes meet at 0.01 rad
_EQUAL_DIGITS = 12  # of the planes of triangles that are one side


class Facet(NamedTuple):
    """A side of a convex solid: corners (K, 3) in order, seen from outside; normal; offset."""

    corners: Float64
    normal: Float64
    offset: float


class Polytope(NamedTuple):
    """A convex solid by its sides: points with planes[:, :3] @ x + planes[:, 3] <= 0."""

    facets: tuple[Facet, ...]
    planes: Float64
    low: Float64
    high: Float64


def polytope(corners: Float64) -> Polytope:
    """The convex hull of points (K, 3), its coplanar triangles joined."""
    hull = ConvexHull(corners)
    _, first, side_of = np.unique(
        hull.equations.round(_EQUAL_DIGITS), axis=0, return_index=True, return_inverse=True
    )
    planes = hull.equations[first]
    facets = []
    for side, plane in enumerate(planes):
        points = corners[np.unique(hull.simplices[side_of.ravel() == side])]
        facets.append(Facet(_in_order(points, plane[:3]), plane[:3], float(plane[3])))
    return Polytope(tuple(facets), planes, corners.min(axis=0), corners.max(axis=0))


def union(solids: Sequence[Float64]) -> TriangleMesh:
    """The closed surface of the union of convex solids, faces counter-clockwise from outside.

    Args:
        solids: corners (K, 3) of each (m). They may overlap, and touch in whole or parts of sides.

    Raises:
        InputError: they touch so nearly that rounding decides where.
    """
    polytopes = [polytope(corners) for corners in solids]
    for tolerance in _TOLERANCES:
        mesh = _sewn(_boundary(polytopes, tolerance), _SAME_CORNER * tolerance)
        if closed(mesh):
            return mesh
    raise InputError("solids touch so nearly that their union has no closed surface; move one")


def _boundary(polytopes: Sequence[Polytope], tolerance: float) -> list[Float64]:
    """Polygons that cover the boundary of the union once."""
    low, high = np.array([p.low for p in polytopes]), np.array([p.high for p in polytopes])
    polygons: list[Float64] = []
    for i, item in enumerate(polytopes):
        near = (low <= item.high + tolerance).all(1) & (high >= item.low - tolerance).all(1)
        neighbours = [(j, polytopes[j]) for j in np.flatnonzero(near).tolist() if j != i]
        for facet in item.facets:
            polygons += _uncovered(facet, i, neighbours, tolerance)
    return polygons


def _uncovered(
    facet: Facet, number: int, neighbours: Sequence[tuple[int, Polytope]], tolerance: float
) -> list[Float64]:
    pieces = [facet.corners]
    for other, solid in neighbours:
        pieces = [
            rest
            for piece in pieces
            for rest in _outside(piece, facet.normal, solid, tolerance, first=number < other)
        ]
        if not pieces:
            break
    return pieces


def _outside(
    polygon: Float64, normal: Float64, solid: Polytope, tolerance: float, *, first: bool
) -> list[Float64]:
    """What of a polygon lies outside a solid; on a common side, the first of two keeps it."""
    height = polygon @ solid.planes[:, :3].T + solid.planes[:, 3]
    above = (height >= -tolerance).all(axis=0)
    if above.any():
        coplanar = (height[:, above] <= tolerance).all(axis=0)
        facing = solid.planes[above, :3] @ normal > 0
        if (~coplanar | (facing & first)).any():
            return [polygon]
    crossed = np.flatnonzero((height > tolerance).any(axis=0))
    pieces, remainder = [], polygon
    for k in crossed:
        heights = remainder @ solid.planes[k, :3] + solid.planes[k, 3]
        front, back = _split(remainder, heights, tolerance)
        if front is not None:
            pieces.append(front)
        if back is None:
            return [polygon]
        remainder = back
    return pieces


def _split(
    polygon: Float64, height: Float64, tolerance: float
) -> tuple[Float64 | None, Float64 | None]:
    """The parts of a convex polygon above and below a plane, None where there is none."""
    sign = np.where(height > tolerance, 1, np.where(height < -tolerance, -1, 0))
    if (sign >= 0).all():
        return polygon, None
    if (sign <= 0).all():
        return None, polygon
    front, back = [], []
    for a in range(len(polygon)):
        b = a + 1 if a + 1 < len(polygon) else 0
        if sign[a] >= 0:
            front.append(polygon[a])
        if sign[a] <= 0:
            back.append(polygon[a])
        if sign[a] * sign[b] < 0:
            low, high = (a, b) if sign[a] < 0 else (b, a)  # the same point from either side
            share = height[low] / (height[low] - height[high])
            point = polygon[low] + share * (polygon[high] - polygon[low])
            front.append(point)
            back.append(point)
    return np.array(front), np.array(back)


def _in_order(points: Float64, normal: Float64) -> Float64:
    """Corners of a convex polygon, counter-clockwise about its normal."""
    offset = points - points.mean(axis=0)
    across = offset[np.abs(offset).sum(axis=1).argmax()]
    x, y, z = normal
    turn = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.arctan2(offset @ (turn @ across), offset @ across)
    return points[np.argsort(angle)]


def _sewn(polygons: Sequence[Float64], distance: float) -> TriangleMesh:
    """Polygons that cover a surface once, as triangles whose corners within a distance are one."""
    ends = np.cumsum([len(polygon) for polygon in polygons])
    points, index = _welded(np.concatenate(polygons), distance)
    loops = [_distinct(loop.tolist()) for loop in np.split(index, ends[:-1])]
    loops = _completed([loop for loop in loops if len(loop) > 2], points, distance)
    faces = np.array([face for loop in loops for face in _triangles(loop, points)], dtype=np.int64)
    used, faces = np.unique(faces, return_inverse=True)
    return TriangleMesh(points[used], faces.reshape(-1, 3))


def _welded(points: Float64, distance: float) -> tuple[Float64, NDArray[np.int64]]:
    """Distinct points, and the number of each given one among them."""
    pairs = cKDTree(points).query_pairs(distance, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), (len(points),) * 2)
    _, group = connected_components(links, directed=False)
    _, first = np.unique(group, return_index=True)
    return points[first], group.astype(np.int64)


def _distinct(loop: list[int]) -> list[int]:
    return [a for a, b in zip(loop, loop[1:] + loop[:1], strict=True) if a != b]


def _completed(loops: list[list[int]], points: Float64, distance: float) -> list[list[int]]:
    """Loops with all corners of neighbours that lie on their edges."""
    edges = {edge for loop in loops for edge in zip(loop, loop[1:] + loop[:1], strict=True)}
    open_edges = [edge for edge in edges if edge[::-1] not in edges]
    if not open_edges:
        return loops
    corners = np.unique(open_edges)
    tree = cKDTree(points[corners])
    between = {edge: _between(edge, corners, tree, points, distance) for edge in open_edges}
    completed = []
    for loop in loops:
        chain: list[int] = []
        for edge in zip(loop, loop[1:] + loop[:1], strict=True):
            chain += [edge[0], *between.get(edge, [])]
        completed.append(chain)
    return completed


def _between(
    edge: tuple[int, int],
    corners: NDArray[np.int64],
    tree: cKDTree,
    points: Float64,
    distance: float,
) -> list[int]:
    """Corners on an edge, from its start to its end."""
    start, along = points[edge[0]], points[edge[1]] - points[edge[0]]
    length = float(np.linalg.norm(along))
    near = corners[tree.query_ball_point(start + along / 2, length / 2 + distance)]
    offset = points[near] - start
    at = offset @ along / length**2
    aside = np.linalg.norm(offset - at[:, None] * along, axis=1)
    inside = (aside < 2 * distance) & (at > 0) & (at < 1) & ~np.isin(near, edge)
    return near[inside][np.argsort(at[inside])].tolist()


def _triangles(loop: list[int], points: Float64) -> list[tuple[int, int, int]]:
    """A convex loop as triangles that have an area, cut off one by one, the largest first."""
    remainder, faces = list(loop), []
    while len(remainder) > 3:
        corners = points[remainder]
        sides = np.roll(corners, -1, axis=0) - corners
        k = int(np.argmax(_squared_areas(np.roll(sides, 1, axis=0), sides)))
        faces.append((remainder[k - 1], remainder[k], remainder[(k + 1) % len(remainder)]))
        del remainder[k]
    return [*faces, (remainder[0], remainder[1], remainder[2])]


def _squared_areas(a: Float64, b: Float64) -> Float64:
    """Squared areas of parallelograms with sides (N, 3); faster than a cross product."""
    squared = np.einsum("ij,ij->i", a, a) * np.einsum("ij,ij->i", b, b)
    return np.asarray(squared - np.einsum("ij,ij->i", a, b) ** 2)
