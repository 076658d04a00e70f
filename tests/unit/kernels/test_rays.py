import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import map_coordinates

from scenefw.kernels import rays

SIDE = 6
VOLUME = np.random.default_rng(0).normal(size=(SIDE, SIDE, SIDE)).astype(np.float32)
position = st.floats(-2, SIDE + 1, width=32)


@given(position, position, position)
def test_interpolation_is_trilinear_inside_and_constant_outside(x, y, z):
    point = [np.float32(v) for v in (x, y, z)]
    ours = rays.trilinear(VOLUME.ravel(), 0, SIDE, *point)
    clamped = np.clip(point, 0, SIDE - 1)[:, None]
    expected = map_coordinates(VOLUME.astype(np.float64), clamped, order=1)[0]
    assert abs(ours - expected) < 1e-5


@given(position, position, position)
def test_nearest_voxel_is_at_most_half_a_diagonal_away(x, y, z):
    point = np.array([x, y, z], dtype=np.float32)
    numbers = np.arange(SIDE**3, dtype=np.float32)
    found = np.unravel_index(int(rays.nearest(numbers, 0, SIDE, *point)), (SIDE,) * 3)
    assert np.abs(np.clip(point, 0, SIDE - 1) - found).max() <= 0.5 + 1e-5
