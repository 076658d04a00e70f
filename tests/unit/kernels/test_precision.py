"""Products of coordinates round to float32, whatever surrounds them."""

import numpy as np
import pytest
import torch
from scipy.spatial.distance import cdist

from scenefw.kernels.precision import distances, full_precision


def products(seed=0):
    random = torch.Generator().manual_seed(seed)
    one, other = (torch.randn(3, 3, generator=random) for _ in range(2))
    return one, other, (one.double() @ other.double()).float()


def test_inside_a_mixed_precision_products_are_those_of_doubles():
    one, other, exact = products()
    with torch.autocast("cpu", torch.bfloat16):
        assert not torch.allclose((one @ other).float(), exact, atol=1e-4)
        with full_precision():
            assert torch.allclose(one @ other, exact, atol=1e-6)
        assert (one @ other).dtype == torch.bfloat16


@full_precision()
def interrupted():
    assert torch.get_float32_matmul_precision() == "highest"
    raise ZeroDivisionError


@pytest.mark.parametrize("before", ["high", "highest"])
def test_settings_of_the_process_come_back(before):
    kept = torch.get_float32_matmul_precision()
    try:
        torch.set_float32_matmul_precision(before)
        with pytest.raises(ZeroDivisionError):
            interrupted()
        assert torch.get_float32_matmul_precision() == before
    finally:
        torch.set_float32_matmul_precision(kept)


@pytest.mark.parametrize("count", [5, 40])
def test_distances_are_exact_however_many_points_there_are(count):
    first = 1 + 0.001 * torch.randn(count, 3, generator=torch.Generator().manual_seed(0))
    second = torch.cat([first[:3], first.flip(0) + 1e-4])
    with torch.autocast("cpu", torch.bfloat16):
        found = distances(first, second)
    np.testing.assert_allclose(found, cdist(first.double(), second.double()), atol=1e-7)
    assert (found[range(3), range(3)] == 0).all()
