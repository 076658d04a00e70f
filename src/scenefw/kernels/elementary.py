"""Exponential and logarithm in float32, inlined on the CPU, where the library calls cost most.

Polynomials of the Cephes library (Moshier), relative error below 4e-6 (exp) and 2e-7 (log), for
arguments that need no care: `exp` saturates at 2^-126 and 2^126, `log` takes normal positive
numbers. CUDA and its simulator use their own functions.
"""

import math

import numpy as np
from numba.extending import overload

_HALF = np.float32(0.5)
_ONE = np.float32(1)
_LOG2_E = np.float32(1 / math.log(2))
_LN_2 = np.float32(math.log(2))
_ROOT_2 = np.float32(math.sqrt(2))
_RANGE = np.float32(126)
_ROUNDED_BIAS = np.float32(127.5)
_E1, _E2, _E3, _E4, _E5, _E6 = (
    np.float32(1.9875691500e-4),
    np.float32(1.3981999507e-3),
    np.float32(8.3334519073e-3),
    np.float32(4.1665795894e-2),
    np.float32(1.6666665459e-1),
    np.float32(5.0000001201e-1),
)
_L1, _L2, _L3, _L4, _L5, _L6, _L7, _L8, _L9 = (
    np.float32(7.0376836292e-2),
    np.float32(-1.1514610310e-1),
    np.float32(1.1676998740e-1),
    np.float32(-1.2420140846e-1),
    np.float32(1.4249322787e-1),
    np.float32(-1.6668057665e-1),
    np.float32(2.0000714765e-1),
    np.float32(-2.4999993993e-1),
    np.float32(3.3333331174e-1),
)
_BIAS, _MANTISSA_BITS = np.int32(127), np.int32(23)
_MANTISSA, _ONE_BITS = np.int32(0x7FFFFF), np.int32(0x3F800000)


def exp(x: float) -> float:
    """e^x."""
    return math.exp(x)


def log(x: float) -> float:
    """Natural logarithm of x > 0."""
    return math.log(x)


# numba compares the signatures of an overload and of what it returns, annotations included.
@overload(exp, target="cpu")
def _exp_on_cpu(x):  # noqa: ANN001, ANN202
    def exponential(x):  # noqa: ANN001, ANN202
        t = min(max(np.float32(x) * _LOG2_E, -_RANGE), _RANGE)
        biased = np.int32(t + _ROUNDED_BIAS)  # truncates to the nearest whole number
        f = (t - np.float32(biased - _BIAS)) * _LN_2
        p = ((((_E1 * f + _E2) * f + _E3) * f + _E4) * f + _E5) * f + _E6
        scale = np.int32(biased << _MANTISSA_BITS).view(np.float32)
        return (p * f * f + f + _ONE) * scale

    return exponential


@overload(log, target="cpu")
def _log_on_cpu(x):  # noqa: ANN001, ANN202
    def logarithm(x):  # noqa: ANN001, ANN202
        bits = np.float32(x).view(np.int32)
        exponent = np.float32((bits >> _MANTISSA_BITS) - _BIAS)
        m = np.int32((bits & _MANTISSA) | _ONE_BITS).view(np.float32)
        if m > _ROOT_2:
            m *= _HALF
            exponent += _ONE
        f = m - _ONE
        p = (((_L1 * f + _L2) * f + _L3) * f + _L4) * f + _L5
        p = (((p * f + _L6) * f + _L7) * f + _L8) * f + _L9
        return (p * f - _HALF) * f * f + f + exponent * _LN_2

    return logarithm


@overload(exp, target="cuda")
def _exp_on_cuda(x):  # noqa: ANN001, ANN202
    def exponential(x):  # noqa: ANN001, ANN202
        return math.exp(x)

    return exponential


@overload(log, target="cuda")
def _log_on_cuda(x):  # noqa: ANN001, ANN202
    def logarithm(x):  # noqa: ANN001, ANN202
        return math.log(x)

    return logarithm
