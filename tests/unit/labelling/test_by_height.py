import numpy as np
import pytest
from tests.unit.labelling.fakes import CLASSES, truth

from scenefw.core.errors import ConfigError
from scenefw.labelling.by_height import ByHeight


def test_what_rises_is_an_object():
    whole = truth()
    whole.heights[:, :3] = np.nan
    found = ByHeight(CLASSES, "book").label_map(whole)
    np.testing.assert_array_equal(found[:, :, 3:].argmax(axis=0), (whole.labels > 0)[:, 3:])
    assert found[:, :, :3] == pytest.approx(np.full((3, 33, 3), 1 / 3))
    np.testing.assert_allclose(found.sum(axis=0), 1, atol=1e-6)


def test_settings_are_checked():
    with pytest.raises(ConfigError, match="raised = coin"):
        ByHeight(CLASSES, "coin")
    with pytest.raises(ConfigError, match="confidence"):
        ByHeight(CLASSES, "pen", confidence=0.2)
