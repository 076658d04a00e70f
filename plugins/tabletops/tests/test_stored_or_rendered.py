"""A setting chooses between kept and rendered samples; both show the same scenes."""

import numpy as np
import pytest
import torch

from scenefw import registry
from scenefw.core.errors import ConfigError
from scenefw_tabletops.data import stored_or_rendered
from scenefw_tabletops.data.label_views import RenderedViews, StoredViews
from scenefw_tabletops.data.map_crops import RenderedMaps, StoredMaps

CPU = torch.device("cpu")


@pytest.fixture(scope="module")
def source():
    options = {"limit": 1, "size": [32, 24], "vertices": 65, "cache": None}
    return registry.build("dataset", "tabletop", **options)


def test_views_are_kept_or_rendered(source):
    kept = stored_or_rendered.views(source, views=2, rendered=False)
    rendered = stored_or_rendered.views(source, views=2, renew=3, workers=1, rendered=True)
    assert isinstance(kept, StoredViews)
    assert isinstance(rendered, RenderedViews)
    assert rendered.renew == 3
    one, other = (v.render(np.array([1]), None, CPU) for v in (kept, rendered))
    np.testing.assert_allclose(one.depth, other.depth, atol=1e-3)


def test_maps_are_kept_or_rendered(source):
    kept, rendered = (stored_or_rendered.maps(source, rendered=r) for r in (False, True))
    assert isinstance(kept, StoredMaps)
    assert isinstance(rendered, RenderedMaps)


def test_fused_maps_are_not_rendered(source):
    with pytest.raises(ConfigError, match="rendered=false"):
        stored_or_rendered.maps(source, fused=lambda scene: None, rendered=True)


def test_what_has_no_scenes_is_not_rendered():
    class Recording:
        classes = ("a",)

    with pytest.raises(ConfigError, match="Recording has no scenes"):
        stored_or_rendered.views(Recording(), 1, rendered=True)
