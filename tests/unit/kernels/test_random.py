"""Philox against whole-number arithmetic and published words; distributions; CUDA's simulator."""

import numba
import numpy as np
import pytest
import torch
from scipy import stats
from tests.unit.kernels import analytic

from scenefw.kernels.cameras import stack_cameras
from scenefw.kernels.random import normal, philox, uniform
from scenefw.noise.gaussian import Gaussian
from scenefw.noise.kinect import Kinect


def philox_in_whole_numbers(counter, key):
    """Salmon et al. (2011), figure 4."""
    c, k = list(counter), list(key)
    for _ in range(10):
        first, second = 0xD2511F53 * c[0], 0xCD9E8D57 * c[2]
        high_0, high_1 = first >> 32, second >> 32
        c = [high_1 ^ c[1] ^ k[0], second % 2**32, high_0 ^ c[3] ^ k[1], first % 2**32]
        k = [(k[0] + 0x9E3779B9) % 2**32, (k[1] + 0xBB67AE85) % 2**32]
    return c


@numba.njit(cache=True)  # in a folder named by the sources of all kernels
def words(seed, places, purpose, out):
    for i in range(len(places)):
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = philox(seed, places[i], purpose)


@numba.njit(cache=True)
def distributions(words, uniforms, normals):
    for i in range(len(words)):
        uniforms[i] = uniform(words[i])
        normals[i] = normal(words[i])


def drawn(seed, places, purpose=0):
    places = np.asarray(places, np.int64)
    out = np.empty((len(places), 4), np.uint64)
    words(np.int64(seed), places, purpose, out)
    return out


def test_the_reference_gives_the_published_words():
    assert philox_in_whole_numbers([0] * 4, [0] * 2) == [
        0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8,
    ]  # fmt: skip
    pi = [0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344]
    assert philox_in_whole_numbers(pi, [0xA4093822, 0x299F31D0]) == [
        0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1,
    ]  # fmt: skip


@pytest.mark.parametrize("seed", [0, 1, 2**32 + 7, 2**63 - 1])
@pytest.mark.parametrize("purpose", [0, 2])
def test_words_are_those_of_philox(seed, purpose):
    places = [0, 1, 19199, 307199, 2**32 - 1]
    key = [seed % 2**32, seed >> 32]
    expected = [philox_in_whole_numbers([place, purpose, 0, 0], key) for place in places]
    assert drawn(seed, places, purpose).tolist() == expected


def test_normals_are_the_inverse_of_the_normal_distribution():
    edges = np.array([0, 1, 511, 512, 2**31 - 1, 2**31, 2**32 - 512, 2**32 - 1], np.uint64)
    given = np.concatenate([edges, np.linspace(0, 2**32 - 1, 100_001).astype(np.uint64)])
    uniforms, normals = np.empty((2, len(given)), np.float32)
    distributions(given, uniforms, normals)
    exact = ((given >> np.uint64(9)).astype(np.float64) + 0.5) / 2**23
    assert (uniforms == exact).all()
    assert uniforms.min() > 0
    assert uniforms.max() < 1
    np.testing.assert_allclose(normals, stats.norm.ppf(exact), rtol=1e-5, atol=1e-6)


def test_pixels_images_and_purposes_are_independent_and_uniform():
    count = 40_000
    columns = [
        *drawn(0, range(count)).T,
        *drawn(1, range(count)).T,
        *drawn(0, range(count), purpose=1).T,
        drawn(0, range(1, count + 1))[:, 0],
        np.array([drawn(seed, [7])[0, 0] for seed in range(count)]),
    ]
    values = (np.array(columns, np.float64) + 0.5) / 2**32
    assert min(stats.kstest(column, "uniform").pvalue for column in values) > 1e-4
    for column in values:  # bits of bytes, high and low
        counts = np.bincount((column * 256).astype(int), minlength=256)
        assert stats.chisquare(counts).pvalue > 1e-4
        low = np.bincount((column * 2**32).astype(np.int64) % 256, minlength=256)
        assert stats.chisquare(low).pvalue > 1e-4
    between = np.corrcoef(values)[np.triu_indices(len(values), 1)]
    assert np.abs(between).max() < 5 / np.sqrt(count)


def results():
    """Both noises of a small view, by name."""
    views = [
        analytic.camera(eye, width=24, height=18) for eye in ((0.8, 0.3, 0.6), (-0.2, 0.7, 0.9))
    ]
    cameras = stack_cameras(views)
    depth = torch.stack([analytic.depth(analytic.SCENE, view) for view in views])
    seeds = torch.tensor([3, 2**62 + 5])
    near = {"nearest": 0.1, "lateral": 1.5, "disparity_step": 0.01, "dropout": 0.05}
    found = {
        "gaussian": Gaussian().apply(depth, cameras, seeds),
        "kinect": Kinect(**near, grazing_from=40.0).apply(depth, cameras, seeds),
        "mirrored": Kinect(**near, baseline=-0.1, share=0.5).apply(depth, cameras, seeds),
    }
    return {name: value.numpy() for name, value in found.items()}


def test_the_grid_of_threads_draws_what_the_loop_draws(simulated):
    for name, expected in results().items():
        got = simulated[name]
        assert len(np.unique(expected)) > 50
        assert (np.abs(got - expected) > 1e-5).mean() < 0.01, name  # at a border of rounding
