"""Labels that images hold themselves."""

import numpy as np
import pytest

from scenefw.core.errors import InputError
from scenefw_single_view_benchmarks.stored_labels import StoredLabels


def test_instances_of_an_image(tmp_path):
    instances = np.array([[-1, 0], [1, 2]])
    np.savez(tmp_path / "a.npz", depth=np.ones((2, 2)), instances=instances)
    np.savez(tmp_path / "b.npz", depth=np.ones((2, 2)))
    np.testing.assert_array_equal(StoredLabels().of(tmp_path / "a.npz"), instances)
    assert StoredLabels().of(tmp_path / "b.npz") is None
    (tmp_path / "c.npz").write_bytes(b"PK")
    with pytest.raises(InputError, match=r"c\.npz"):
        StoredLabels().of(tmp_path / "c.npz")
