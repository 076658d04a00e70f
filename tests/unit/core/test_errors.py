import numpy as np
import pytest

from scenefw.core.errors import InputError, require_whole


@pytest.mark.parametrize("value", [3, 4, np.int64(3), np.uint8(200), 10**30])
def test_whole_numbers_pass(value):
    require_whole(value, "count", minimum=3)


@pytest.mark.parametrize("value", ["a", "3", 3.0, 2.5, True, None, [3], float("nan"), -1, 2])
def test_anything_else_is_one_line(value):
    with pytest.raises(InputError) as error:
        require_whole(value, "count", minimum=3)
    assert str(error.value) == f"count is {value!r}; expected a whole number, 3 or more"
