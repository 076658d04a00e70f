"""Division of meshes into convex parts (CoACD: Wei et al., SIGGRAPH 2022)."""

from __future__ import annotations

import contextlib

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from scenefw.core.settings import COUNT, SHARE, between
from scenefw.core.types import Float64, TriangleMesh
from scenefw.shapes.moments import moments

CONCAVITY = between(0.01, 1)
"""What CoACD takes."""


class ConvexParts:
    """Divides meshes that their convex hull exceeds, with CoACD where it is installed.

    Args:
        convex: a mesh that fills this share of its convex hull collides as that hull.
        threshold: concavity that may stay, of CoACD (0.01 to 1).
        most: parts of an object at most.
        seed: of the search for cuts.

    Raises:
        ConfigError: a share or threshold that is none, or fewer parts than one.
    """

    def __init__(
        self, convex: float = 0.85, threshold: float = 0.1, most: int = 24, seed: int = 0
    ) -> None:
        SHARE.require(convex=convex)
        CONCAVITY.require(threshold=threshold)
        COUNT.require(most=most)
        self.convex, self.threshold, self.most, self.seed = convex, threshold, most, seed

    def of(self, mesh: TriangleMesh) -> tuple[Float64, ...]:
        """Corners (K, 3) of each part; empty where the convex hull does, or nothing can divide."""
        if fills_hull(mesh) >= self.convex:
            return ()
        with contextlib.suppress(ImportError, OSError):
            import open3d  # noqa: F401  # after CoACD its import fails (std::bad_cast)
        try:
            import coacd
        except ImportError:
            return ()
        coacd.set_log_level("error")
        divided = coacd.run_coacd(
            coacd.Mesh(mesh.vertices, mesh.faces.astype(np.int32)),
            threshold=self.threshold,
            max_convex_hull=self.most,
            preprocess_mode="off",  # it inflates parts, takes long, and has ended whole processes
            resolution=500,  # a quarter of the default's points: parts differ little, time a lot
            mcts_iterations=30,
            mcts_nodes=10,
            mcts_max_depth=2,
            max_ch_vertex=64,
            seed=self.seed,
        )
        return tuple(np.asarray(vertices, dtype=np.float64) for vertices, _ in divided)


def fills_hull(mesh: TriangleMesh) -> float:
    """Share of its convex hull that a closed mesh fills; 1 where there is no hull."""
    try:
        return moments(mesh).volume / float(ConvexHull(mesh.vertices).volume)
    except QhullError:  # flat
        return 1.0
