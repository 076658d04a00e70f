import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from scenefw.perception.observation.points import points_by_label


@given(arrays(np.int32, array_shapes(min_dims=2, max_dims=2), elements=st.integers(-1, 4)))
def test_each_label_has_the_points_of_its_pixels_in_their_order(labels):
    points = np.arange(3.0 * labels.size).reshape(*labels.shape, 3)
    groups = points_by_label(labels, points)
    assert list(groups) == np.unique(labels[labels > 0]).tolist()
    for label, places in groups.items():
        np.testing.assert_array_equal(places, points[labels == label])
