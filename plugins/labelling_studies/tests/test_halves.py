"""Two halves of a recording: what exact, noisy and confused ones say."""

import numpy as np
import pytest
from tests.unit.tasks.recordings import CLASSES, GRID, frames, table

from scenefw.core.errors import ConfigError, InputError
from scenefw.data.files.sequences import write_sequence
from scenefw.labelling.sources import TrueLabels
from scenefw.labelling.view_based import ViewBased
from scenefw.mapping.height_fusion import HeightFusion
from scenefw.mapping.semantic_fusion import SemanticFusion
from scenefw.noise.frames import disturb
from scenefw.noise.gaussian import Gaussian
from scenefw_labelling_studies.halves import LabellingHalves, compared


def strategies(error_rate=0.0, confidence=1.0):
    source = TrueLabels(CLASSES, error_rate, confidence)
    return {"view_based": ViewBased(HeightFusion(GRID), SemanticFusion(), source)}


def values(folder, **errors):
    figures = LabellingHalves(folder, strategies(**errors)).run().figures
    return {name.removeprefix("view_based/"): value for name, value in figures.items()}


def test_more_noise_and_more_wrong_labels_are_seen_without_any_truth(tmp_path):
    exact = write_sequence(tmp_path / "exact", frames(), CLASSES)
    noise = {"gaussian": Gaussian(0.004)}
    disturbed = (disturb(f, noise, 0, 0, i) for i, f in enumerate(frames()))
    noisy = write_sequence(tmp_path / "noisy", disturbed, CLASSES)
    good, bad = values(exact), values(noisy, error_rate=0.6, confidence=0.5)
    assert good["frames"] == 6
    assert good["agreement"] > 0.97 > good["chance"]
    assert good["roughness"] < 1e-4
    assert good["tilt"] < 0.1
    assert bad["height_median"] > 5 * good["height_median"]
    assert bad["roughness"] > 5 * good["roughness"]
    assert bad["agreement"] < good["agreement"] - 0.02
    assert bad["miou"] < good["miou"] - 0.02


def test_a_map_agrees_with_itself():
    found = compared(table(), table(), flat=0.01)
    assert (found["agreement"], found["miou"], found["overlap"]) == (1, 1, 1)
    assert found["height_rms"] == 0
    shares = np.bincount(table().labels.ravel()) / table().labels.size
    assert found["chance"] == pytest.approx((shares**2).sum())


def test_what_can_not_be_compared_says_so(tmp_path):
    one = write_sequence(tmp_path / "one", frames(1), CLASSES)
    with pytest.raises(InputError, match="2 or more"):
        LabellingHalves(one, strategies()).run()
    with pytest.raises(ConfigError, match="input=FOLDER"):
        LabellingHalves(None, strategies())
    with pytest.raises(ConfigError, match="no strategy"):
        LabellingHalves(one, {})
    with pytest.raises(ConfigError, match="leave odometry"):
        LabellingHalves(one, strategies(), estimate_poses=True)
