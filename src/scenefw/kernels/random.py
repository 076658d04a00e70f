"""Random numbers that are functions of a seed and a place: the same on every device, in any order.

Philox 4x32-10 (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", 2011): four words of
32 bits for each 64-bit counter and 64-bit key. Words are kept in uint64, as products need them; all
constants are uint64 too, as numba makes floats of mixed signs.
"""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN201

import math

import numpy as np

from scenefw.kernels.compile import vectorised
from scenefw.kernels.elementary import log

_FACTOR_A, _FACTOR_B = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
_WEYL_A, _WEYL_B = np.uint64(0x9E3779B9), np.uint64(0xBB67AE85)
_WORD, _BITS = np.uint64(0xFFFFFFFF), np.uint64(32)
_KEPT = np.uint64(9)  # bits too many for the 23 that float32 holds strictly between 0 and 1
_ROUNDS = 10
_HALF = np.float32(0.5)
_UNIT = np.float32(2.0**-23)
_ONE, _FOUR = np.float32(1), np.float32(4)
_CENTRAL, _MIDDLE, _TAIL = np.float32(5), np.float32(2.5), np.float32(3)
_ROOT_2 = np.float32(math.sqrt(2))
_C8, _C7, _C6, _C5, _C4, _C3, _C2, _C1, _C0 = (
    np.float32(2.81022636e-08),
    np.float32(3.43273939e-07),
    np.float32(-3.5233877e-06),
    np.float32(-4.39150654e-06),
    np.float32(0.00021858087),
    np.float32(-0.00125372503),
    np.float32(-0.00417768164),
    np.float32(0.246640727),
    np.float32(1.50140941),
)
_T8, _T7, _T6, _T5, _T4, _T3, _T2, _T1, _T0 = (
    np.float32(-0.000200214257),
    np.float32(0.000100950558),
    np.float32(0.00134934322),
    np.float32(-0.00367342844),
    np.float32(0.00573950773),
    np.float32(-0.0076224613),
    np.float32(0.00943887047),
    np.float32(1.00167406),
    np.float32(2.83297682),
)


@vectorised
def philox(seed, place, purpose):
    """Four words (uint64 below 2^32) of a seed, a place (below 2^32) and a small whole number."""
    a, b = np.uint64(place), np.uint64(purpose)
    c, d = np.uint64(0), np.uint64(0)
    key_a, key_b = np.uint64(seed) & _WORD, np.uint64(seed) >> _BITS
    for _ in range(_ROUNDS):
        first, second = _FACTOR_A * a, _FACTOR_B * c
        a, b = (second >> _BITS) ^ b ^ key_a, second & _WORD
        c, d = (first >> _BITS) ^ d ^ key_b, first & _WORD
        key_a, key_b = (key_a + _WEYL_A) & _WORD, (key_b + _WEYL_B) & _WORD
    return a, b, c, d


@vectorised
def uniform(word):
    """A float32 strictly between 0 and 1, one of 2^23."""
    return (np.float32(word >> _KEPT) + _HALF) * _UNIT


@vectorised
def normal(word):
    """A standard normal float32: the inverse of the normal distribution at `uniform`.

    Giles, "Approximating the erfinv function" (2011), in single precision.
    """
    u = uniform(word)
    w = -log(_FOUR * u * (_ONE - u))
    c = w - _MIDDLE
    central = (((_C8 * c + _C7) * c + _C6) * c + _C5) * c + _C4
    central = (((central * c + _C3) * c + _C2) * c + _C1) * c + _C0
    t = math.sqrt(w) - _TAIL
    tail = (((_T8 * t + _T7) * t + _T6) * t + _T5) * t + _T4
    tail = (((tail * t + _T3) * t + _T2) * t + _T1) * t + _T0
    return _ROOT_2 * (central if w < _CENTRAL else tail) * (u + u - _ONE)
