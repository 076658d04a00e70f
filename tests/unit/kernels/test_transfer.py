import numpy as np
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from scenefw.kernels.transfer import pack, to_device, unpack

TYPES = st.sampled_from([np.float32, np.int64, np.uint8, np.float64, np.int32])
SHAPES = arrays.array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=5)


@given(st.lists(arrays.arrays(TYPES, SHAPES), min_size=1, max_size=4))
def test_what_is_packed_comes_out_again(given_arrays):
    tensors = unpack(torch.from_numpy(pack(given_arrays)), given_arrays)
    for tensor, array in zip(tensors, given_arrays, strict=True):
        assert tensor.is_contiguous()
        assert tensor.data_ptr() % array.itemsize == 0
        assert tensor.numpy().dtype == array.dtype
        np.testing.assert_array_equal(tensor.numpy(), array)


def test_the_cpu_gets_the_arrays_themselves():
    array = np.arange(6.0).reshape(2, 3)
    tensor, turned = to_device([array, array.T], "cpu")
    assert tensor.data_ptr() == array.ctypes.data
    assert turned.tolist() == array.T.tolist()
    assert turned.is_contiguous()
