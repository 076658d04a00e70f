import json
from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file
from tests.composed import base

from scenefw.core.batches import ShapeInstanceBatch
from scenefw.core.errors import CheckpointError, ConfigError, InputError, StorageError
from scenefw.core.types import GridSpec
from scenefw.learning.checkpoint import (
    load_checkpoint,
    save_checkpoint,
    shipped_checkpoint,
    weights_file,
)
from scenefw.models.shape_instance_vae import ShapeInstanceVAE

GRID = GridSpec(16, 0.8, (-0.4, -0.4, -0.1), 3.0)


@pytest.fixture
def model():
    torch.manual_seed(0)
    return ShapeInstanceVAE(
        16,
        latent_size=4,
        code_width=0,
        prior_share=0.4,
        bottleneck=4,
        condition_widths=(4, 4, 4, 4, 4),
        encoder_widths=(4, 4, 4, 4, 4),
        decoder_widths=(4, 4, 4, 4, 4),
        stem_width=4,
        branch_width=4,
    )


@pytest.fixture
def path(tmp_path, model):
    save_checkpoint(tmp_path / "net.safetensors", model, model.recipe, GRID, {"steps": 7})
    return tmp_path / "net.safetensors"


def test_one_line_rebuilds_it(path, model):
    found = load_checkpoint(path)
    condition = torch.rand(1, 2, 16, 16, 16)
    assert not found.model.training
    assert torch.equal(found.model.predict(condition).tsdf, model.eval().predict(condition).tsdf)
    assert found.grid == GRID
    assert found.metadata == {"steps": 7}
    assert found.recipe == model.recipe


def test_half_the_size_is_nearly_the_same(tmp_path, path, model):
    small = tmp_path / "half.safetensors"
    save_checkpoint(small, model, model.recipe, GRID, half=True)
    assert small.stat().st_size < 0.75 * path.stat().st_size
    found = load_checkpoint(small).model
    for mine, theirs in zip(found.state_dict().values(), model.state_dict().values(), strict=True):
        assert mine.dtype == theirs.dtype
        torch.testing.assert_close(mine, theirs, rtol=1e-3, atol=1e-4)


def test_channels_last_weights_are_stored_plainly(tmp_path, model):
    last = model.to(memory_format=torch.channels_last_3d)
    save_checkpoint(tmp_path / "last.safetensors", last, model.recipe, GRID)
    found = load_checkpoint(tmp_path / "last.safetensors").model.state_dict()
    for name, value in last.state_dict().items():
        assert torch.equal(found[name], value)


def test_a_full_disk_leaves_the_old_weights_alone(tmp_path, path, model, full_disk):
    before = path.read_bytes()
    with full_disk(5000), pytest.raises(StorageError, match="File too large"):
        save_checkpoint(path, model, model.recipe, GRID)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_missing_file_names_the_way_out(tmp_path):
    with pytest.raises(CheckpointError, match="run=train"):
        load_checkpoint(tmp_path / "none.safetensors")


@pytest.mark.parametrize("keep", [0, 5, 300, -10])
def test_truncated_file_is_one_line(path, keep):
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(CheckpointError, match="truncated") as caught:
        load_checkpoint(path)
    assert "\n" not in str(caught.value)


def test_foreign_files_are_refused(tmp_path):
    foreign = tmp_path / "foreign.safetensors"
    save_file({"weight": torch.zeros(2)}, str(foreign))
    with pytest.raises(CheckpointError, match="not a scenefw checkpoint"):
        load_checkpoint(foreign)
    text = tmp_path / "text.safetensors"
    text.write_text("these are no weights at all, whatever the name says")
    with pytest.raises(CheckpointError, match="not a safetensors file"):
        load_checkpoint(text)


def rewrite(path, model, **changes):
    header = {
        "version": 1,
        "recipe": model.recipe,
        "grid": {"resolution": 16, "extent": 1.0, "lower": [0, 0, 0], "truncation_voxels": 5.0},
        "versions": {"scenefw": "9.9"},
        "metadata": {},
        **changes,
    }
    save_file(model.state_dict(), str(path), {"scenefw-checkpoint": json.dumps(header)})


def test_another_version_is_refused(path, model):
    rewrite(path, model, version=99)
    with pytest.raises(CheckpointError, match=r"version 99.*9\.9"):
        load_checkpoint(path)


def test_weights_of_another_network_are_refused(path, model):
    rewrite(path, model, recipe={**model.recipe, "latent_size": 5})
    with pytest.raises(CheckpointError, match="don't fit"):
        load_checkpoint(path)


@pytest.mark.parametrize(
    "target",
    ["os.system", "torch.nn.Linear", "scenefw.models.missing.Net", "scenefw.core.rng.generator"],
)
def test_a_recipe_calls_nothing_but_networks(path, model, target):
    rewrite(path, model, recipe={"_target_": target})
    with pytest.raises(CheckpointError, match=target.split(".")[-1]):
        load_checkpoint(path)


def test_damaged_header_is_refused(path, model):
    save_file(model.state_dict(), str(path), {"scenefw-checkpoint": "{not json"})
    with pytest.raises(CheckpointError, match="header"):
        load_checkpoint(path)
    rewrite(path, model, grid={"side": 3})
    with pytest.raises(CheckpointError, match="header"):
        load_checkpoint(path)


def test_the_shipped_checkpoint_predicts():
    if not shipped_checkpoint().exists():
        pytest.skip("the weights are not part of this checkout")
    found = load_checkpoint()
    size = (found.grid.resolution,) * 3
    condition = torch.ones(1, found.model.channels, *size)
    with torch.no_grad():
        empty = found.model.predict(condition)
    assert empty.tsdf.shape == (1, 1, *size)
    assert shipped_checkpoint().stat().st_size <= 12 * 2**20


def test_what_only_training_needs_can_be_left_out(tmp_path, path, model):
    lean = tmp_path / "lean.safetensors"
    save_checkpoint(lean, model, model.recipe, GRID, omit=model.training_only)
    found = load_checkpoint(lean).model
    condition = torch.rand(2, 2, 16, 16, 16)
    assert torch.equal(found.predict(condition).votes, model.eval().predict(condition).votes)
    assert lean.stat().st_size < path.stat().st_size
    targets = {"tsdf": condition[:, :1], "votes": torch.zeros(2, 3, 16, 16, 16)}
    batch = ShapeInstanceBatch(condition, targets)
    with pytest.raises(InputError, match="without its encoder"):
        found(batch)


def test_unknown_weights_are_told_which_there_are():
    with pytest.raises(CheckpointError, match="simstack"):
        load_checkpoint("nothing")
    with pytest.raises(ConfigError, match=r"^path = null: .*'nothing'.*simstack"):
        load_checkpoint(shipped="nothing")


@pytest.mark.parametrize(("name", "kind"), [("label_views", "views"), ("label_maps", "maps")])
def test_the_labelling_networks_that_ship_say_what_they_are(name, kind):
    found = load_checkpoint(task="segmentation", shipped=name)
    assert found.metadata["input"] == kind
    assert found.metadata["classes"] == list(base().classes)
    assert found.model.classes == 11
    assert shipped_checkpoint(name).stat().st_size < 12e6


def test_names_and_files_of_weights(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert weights_file(None) == shipped_checkpoint("simstack")
    assert weights_file(None, "label_views") == shipped_checkpoint("label_views")
    assert weights_file("label_maps") == shipped_checkpoint("label_maps")
    for path in (
        shipped_checkpoint("label_maps"),
        Path("x.safetensors"),
        Path("folder/label_maps"),
    ):
        assert weights_file(str(path)) == path
    with pytest.raises(CheckpointError, match=r"'nothing' .* give a file, or one of label_maps"):
        weights_file("nothing")
    (tmp_path / "label_maps").touch()  # a file of the user's goes before
    assert weights_file("label_maps") == Path("label_maps")
    assert load_checkpoint("simstack").model is not None


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_weights_that_are_not_finite_are_named_with_their_file(path, model, value):
    name, weights = next(iter(model.named_parameters()))
    with torch.no_grad():
        weights.view(-1)[3] = value
    save_checkpoint(path, model, model.recipe, GRID)
    with pytest.raises(CheckpointError, match=rf"{name} in .*net\.safetensors holds .*finite"):
        load_checkpoint(path)


def test_a_header_of_no_grid_is_damaged(path, model):
    rewrite(path, model, grid={"resolution": 1, "extent": 1.0, "lower": [0, 0, 0]})
    with pytest.raises(CheckpointError, match=r"header of .*net\.safetensors is damaged"):
        load_checkpoint(path)
