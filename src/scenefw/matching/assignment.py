"""Optimal one-to-one assignment."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from scenefw.core.errors import InputError


class Assignment:
    """Pairs rows with columns at least total cost (Kuhn 1955); the shorter side is used up."""

    def assign(self, cost: NDArray[np.float64]) -> NDArray[np.int64]:
        """Pairs (K, 2) of (row, column), ascending by row.

        Args:
            cost: (R, C), finite; negate overlaps to match by largest overlap.

        Raises:
            InputError: the cost is not a matrix or not finite.
        """
        cost = np.asarray(cost, dtype=np.float64)
        if cost.ndim != 2 or not np.isfinite(cost).all():
            raise InputError(
                f"cost has shape {cost.shape}, expected a finite (rows, columns) matrix; use a "
                "large number for pairs that must not match"
            )
        return np.stack(linear_sum_assignment(cost), axis=1).astype(np.int64)
