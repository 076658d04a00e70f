from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from PIL import Image
from tests.unit.data.rectangles import Rectangles

from scenefw.core.errors import CheckpointError, ConfigError, InputError
from scenefw.labelling.sliding_window import SlidingWindow
from scenefw.labelling.sources import (
    MaskFiles,
    NetworkLabels,
    NetworkMapLabels,
    TrueLabels,
)
from scenefw.models.fusenet import FuseNet

CLASSES = ("surface", "red", "blue")


@pytest.fixture
def frame():
    return next(Rectangles().frames(0, 1))


def checkpoint(kind):
    torch.manual_seed(0)
    model = FuseNet(3, (4, 4), (1, 1)).eval()
    return SimpleNamespace(model=model, metadata={"classes": list(CLASSES), "input": kind})


def test_a_network_labels_a_view(frame):
    found = NetworkLabels(checkpoint("views"), CLASSES).label(frame)
    assert found.shape == (3, *frame.depth.shape)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found.sum(axis=0), 1, atol=1e-5)
    deeper = replace(frame, depth=frame.depth * 2)
    assert not np.allclose(found, NetworkLabels(checkpoint("views")).label(deeper))
    with pytest.raises(InputError, match="no colour"):
        NetworkLabels(checkpoint("views")).label(replace(frame, colour=None))


def test_a_network_labels_a_map_where_it_is_seen():
    whole = Rectangles().truth(0)
    heights = whole.heights.copy()
    heights[:20] = np.nan
    found = NetworkMapLabels(checkpoint("maps"), SlidingWindow(window=40)).label_map(
        replace(whole, heights=heights)
    )
    assert found.shape == (3, 65, 65)
    np.testing.assert_allclose(found.sum(axis=0), 1, atol=1e-5)
    np.testing.assert_allclose(found[:, :20], 1 / 3)
    assert np.abs(found[:, 20:] - 1 / 3).max() > 0.01


class ByHeightWindow:
    """Labels vertices by their heights alone, and keeps the size of the map it was given."""

    def probabilities(self, network, colour, distance):
        self.size = distance.shape[1]
        assert colour.shape == (3, *distance.shape[1:])
        high = (distance[0] > 0.01).float()
        return torch.stack([1 - high, high, 0 * high])


@pytest.mark.parametrize(
    ("spacing", "size", "min_agreement"),
    [(None, 65, 1), (1, 65, 1), (0.5, 129, 1), (3, 22, 0.85)],
)
def test_a_map_is_labelled_at_the_spacing_that_was_learned(spacing, size, min_agreement):
    truth = Rectangles().truth(0)
    network, window = checkpoint("maps"), ByHeightWindow()
    if spacing is not None:
        network.metadata["spacing"] = spacing * truth.grid.spacing
    labels = NetworkMapLabels(network, window).label_map(truth).argmax(axis=0)
    assert window.size == size
    expected = truth.heights > 0.01
    assert 0.02 < expected.mean() < 0.98
    assert (labels == expected).mean() >= min_agreement


def test_another_networks_classes_are_one_line():
    with pytest.raises(CheckpointError, match="red, blue, expected surface, coin") as caught:
        NetworkLabels(checkpoint("views"), ("surface", "coin"))
    assert "\n" not in str(caught.value)
    with pytest.raises(CheckpointError, match="trained on maps"):
        NetworkLabels(checkpoint("maps"))
    with pytest.raises(CheckpointError, match="trained on views"):
        NetworkMapLabels(checkpoint("views"))


def test_the_truth_and_a_share_of_it(frame):
    frame.labels[0, 0] = -1
    found = TrueLabels(CLASSES, 0.0, 1.0).label(frame)
    np.testing.assert_array_equal(found.argmax(axis=0)[1:], frame.labels[1:])
    np.testing.assert_allclose(found[:, 0, 0], 1 / 3)
    np.testing.assert_allclose(found.max(axis=0)[1:], 1)
    source = TrueLabels(CLASSES, error_rate=0.3, confidence=0.8)
    wrong = source.label(frame)
    assert (wrong.argmax(axis=0) != frame.labels).mean() == pytest.approx(0.3, abs=0.05)
    np.testing.assert_allclose(wrong[:, 1:].max(axis=0), 0.8)
    np.testing.assert_allclose(wrong.sum(axis=0), 1, atol=1e-6)
    np.testing.assert_array_equal(wrong, source.label(frame))
    assert not np.array_equal(wrong, source.label(replace(frame, name="another")))
    with pytest.raises(InputError, match="no true labels"):
        TrueLabels(CLASSES, 0.0, 1.0).label(replace(frame, labels=None))
    with pytest.raises(ConfigError, match="error_rate"):
        TrueLabels(CLASSES, error_rate=2, confidence=1.0)


def test_files_of_masks(frame, tmp_path):
    frame = replace(frame, name="folder/7")
    mask = frame.labels.astype(np.uint8)
    mask[0, 0] = 255
    path = tmp_path / "folder" / "7.png"
    path.parent.mkdir()
    Image.fromarray(mask).save(path)
    found = MaskFiles(tmp_path, CLASSES, confidence=0.9).label(frame)
    np.testing.assert_array_equal(found.argmax(axis=0)[1:], frame.labels[1:])
    np.testing.assert_allclose(found[:, 0, 0], 1 / 3)
    with pytest.raises(InputError, match="class id 2"):
        MaskFiles(tmp_path, CLASSES[:2]).label(frame)
    with pytest.raises(InputError, match=r"8\.png"):
        MaskFiles(tmp_path, CLASSES).label(replace(frame, name="folder/8"))
    Image.fromarray(mask[:5]).save(path)
    with pytest.raises(InputError, match="size of the frame"):
        MaskFiles(tmp_path, CLASSES).label(frame)
    path.write_text("no picture")
    with pytest.raises(InputError, match="cannot read"):
        MaskFiles(tmp_path, CLASSES).label(frame)


def test_a_network_sees_the_geometry_that_it_was_trained_on(frame):
    trained = checkpoint("views")
    by_depth = NetworkLabels(trained).label(frame)
    trained.metadata["geometry"] = "height"
    by_height = NetworkLabels(trained).label(frame)
    assert not np.allclose(by_depth, by_height)
    higher = frame.camera.T_world_camera.copy()
    higher[2, 3] += 0.5
    moved = replace(frame, camera=frame.camera.moved(higher))
    assert not np.allclose(by_height, NetworkLabels(trained).label(moved))


def test_masks_lie_in_the_recording_or_a_folder_of_their_own(tmp_path):
    assert MaskFiles(None, CLASSES, recording=tmp_path).folder == tmp_path / "masks"
    assert MaskFiles("mine", CLASSES, recording=tmp_path).folder == Path("mine")
    with pytest.raises(ConfigError, match=r"label_source\.folder"):
        MaskFiles(None, CLASSES)


@pytest.mark.parametrize("confidence", [0.05, 1 / len(CLASSES), 1.01, 95])
def test_a_confidence_that_is_no_probability_is_refused(tmp_path, confidence):
    with pytest.raises(ConfigError, match="expected more than"):
        MaskFiles(tmp_path, CLASSES, confidence)
    with pytest.raises(ConfigError, match="expected more than"):
        TrueLabels(CLASSES, 0.0, confidence)
