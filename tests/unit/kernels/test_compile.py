import pytest

from scenefw.kernels.compile import lacks_toolkit


class DynamicLibNotFoundError(RuntimeError):
    """Named as that of the finder of CUDA's libraries, which needs not be installed."""


@pytest.mark.parametrize(
    ("error", "lacks"),
    [
        (DynamicLibNotFoundError("nvvm"), True),
        (ImportError("no driver"), True),
        (RuntimeError("out of memory"), False),
        (ValueError("shape"), False),
    ],
)
def test_missing_libraries_of_cuda_are_told_from_other_errors(error, lacks):
    assert lacks_toolkit(error) is lacks
