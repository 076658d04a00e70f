"""The inlined exponential and logarithm against numpy's."""

import numba
import numpy as np

from scenefw.kernels.elementary import exp, log


@numba.njit(cache=True)  # in a folder named by the sources of all kernels
def _exponentials(x, out):
    for i in range(len(x)):
        out[i] = exp(x[i])


@numba.njit(cache=True)
def _logarithms(x, out):
    for i in range(len(x)):
        out[i] = log(x[i])


def test_exponential():
    x = np.linspace(-87, 87, 100_001, dtype=np.float32)
    out = np.empty_like(x)
    _exponentials(x, out)
    truth = np.exp(x.astype(float))
    assert np.abs(out / truth - 1).max() < 5e-6


def test_exponential_saturates():
    out = np.empty(4, np.float32)
    _exponentials(np.array([-1e4, -np.inf, 1e4, np.inf], np.float32), out)
    assert (out[:2] < 1e-37).all()
    assert (out[:2] >= 0).all()
    assert (out[2:] > 1e37).all()
    assert np.isfinite(out).all()


def test_logarithm():
    powers = np.linspace(-80, 80, 100_001)
    x = np.concatenate([np.exp(powers), np.linspace(0.5, 2, 10_001)]).astype(np.float32)
    out = np.empty_like(x)
    _logarithms(x, out)
    truth = np.log(x.astype(float))
    assert (np.abs(out - truth) <= 2e-7 * np.maximum(np.abs(truth), 1e-3)).all()
