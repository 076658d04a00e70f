"""Descriptions of a superquadric that say the same solid."""

from __future__ import annotations

import functools
import itertools

import torch
from torch import Tensor


@functools.cache
def equal_descriptions() -> Tensor:
    """Rotations (24, 3, 3) that relabel axes, with signs: the solid stays what it is (sets.md).

    A superquadric of three exponents with rotation R, half-axes a and exponents r is the same as
    one with R P, |P|^T a and |P|^T r. Callers share the tensor and only read it.
    """
    rotations = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            matrix = torch.zeros(3, 3)
            for column, (row, sign) in enumerate(zip(order, signs, strict=True)):
                matrix[row, column] = sign
            if torch.linalg.det(matrix) > 0:
                rotations.append(matrix)
    return torch.stack(rotations)
