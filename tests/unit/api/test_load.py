import json
import subprocess
import sys

import numpy as np
import pytest
import torch
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import QuotedString
from hypothesis import example, given
from hypothesis import strategies as st
from PIL import Image
from tests.unit.perception.synthetic import camera_at, frame_of

import scenefw
from scenefw.api.load import _override_value
from scenefw.core.errors import CheckpointError, ConfigError, InputError
from scenefw.core.types import GridSpec
from scenefw.export.summary import summarise
from scenefw.learning.checkpoint import save_checkpoint
from scenefw.models.shape_instance_vae import ShapeInstanceVAE

CAMERA = camera_at(eye=(0.0, -0.85, 0.6), size=(160, 120))
WORDS = ["reconstructor=network", "reconstructor.samples=2"]  # fits take longer
DEPTH = np.rint(frame_of(CAMERA).depth * 1000).astype(np.uint16)


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    """An untrained network of a small grid."""
    widths = [4] * 5
    torch.manual_seed(0)
    model = ShapeInstanceVAE(16, 1, 8, 8, widths, widths, widths, 4, 4)
    recipe = {"_target_": "scenefw.models.shape_instance_vae.ShapeInstanceVAE", **model.recipe}
    path = tmp_path_factory.mktemp("weights") / "net.safetensors"
    save_checkpoint(path, model, recipe, GridSpec(resolution=16))
    return path


@pytest.fixture(scope="module")
def predictor(weights):
    return scenefw.load("reconstruction", *WORDS, checkpoint=weights, device="cpu")


def test_the_same_image_gives_what_the_command_line_gives(predictor, weights, tmp_path, scenefw):
    np.save(tmp_path / "view.npy", DEPTH)
    np.savetxt(tmp_path / "K.txt", CAMERA.matrix)
    words = ["run=predict", *WORDS, "device=cpu", "run.overview=false", "paths.output=out"]
    done = scenefw(*words, f"input={tmp_path / 'view.npy'}", f"checkpoint={weights}")
    assert done.returncode == 0, done.stderr
    found = predictor.predict(DEPTH, CAMERA.matrix, name="view")
    assert len(found.objects) >= 2
    for number, folder in enumerate(["", "hypothesis_2"]):
        written = tmp_path / "out" / "view" / folder
        with Image.open(written / "masks.png") as image:
            np.testing.assert_array_equal(np.array(image), found.samples[number].masks)
        told = json.loads((written / "scene.json").read_text())
        mine = json.loads(json.dumps(summarise(found.samples[number], {})))
        for theirs, own in zip(told["objects"], mine["objects"], strict=True):
            assert theirs.pop("mesh")
            del own["mesh"]
            assert theirs == own
        assert told["camera"] == mine["camera"]
        assert told["floor"] == mine["floor"]
    from_file = predictor.predict(tmp_path / "view.npy")
    np.testing.assert_array_equal(from_file.estimate.tsdf, found.estimate.tsdf)


def test_errors_are_those_of_the_command_line(predictor, weights, tmp_path, scenefw):
    np.savez(tmp_path / "image.npz", depth=DEPTH.astype(float), K=CAMERA.matrix)
    done = scenefw("run=predict", "input=image.npz", "reconstructor=fitted",
                   f"checkpoint={weights}", "device=cpu")  # fmt: skip
    with pytest.raises(InputError) as caught:
        predictor.predict(DEPTH.astype(float), CAMERA.matrix, name="image.npz")
    assert done.stderr == f"error: {caught.value}\n"
    done = scenefw("run=predict", "fit=joined")
    with pytest.raises(ConfigError) as wrong:
        load("reconstruction", fit="joined")
    assert done.stderr.startswith(f"error: {wrong.value}")


def load(*words, **settings):
    return scenefw.load(*words, **settings)


@pytest.mark.parametrize(
    ("words", "settings", "error", "said"),
    [
        (["reconstructon"], {}, ConfigError, "did you mean reconstruction"),
        ([3], {}, ConfigError, r"takes words, got 3 \(int\)"),
        (["reconstruction", 3], {}, ConfigError, r"takes words, got 3 \(int\)"),
        (["reconstruction"], {"fitt": 1}, ConfigError, "there is no key 'fitt'; did you mean fit?"),
        (["reconstruction"], {"labelling": "rule"}, ConfigError, "changes nothing"),
        (["reconstruction", "run.overview=false"], {}, ConfigError, "does not read run.overview"),
        (["reconstruction"], {"seed": -1}, ConfigError, "seed is -1"),
        (["reconstruction"], {"device": "gpu"}, ConfigError, "device=gpu is unknown"),
        (
            ["reconstruction", "checkpoints.set_extents=no.safetensors"],
            {},
            CheckpointError,
            "no checkpoint at",
        ),
        (
            ["reconstruction", "reconstructor=fitted"],
            {"checkpoint": "no file.safetensors"},
            CheckpointError,
            "no checkpoint at",
        ),
        (
            ["reconstruction"],
            {"checkpoint": "my.safetensors"},
            ConfigError,
            "or an option that reads it",
        ),
        (["labelling"], {"labelling": ["rule", "hybrid"]}, ConfigError, "takes one strategy"),
    ],
)
def test_wrong_settings_are_one_line(words, settings, error, said):
    with pytest.raises(error, match=said):
        load(*words, **settings)


def test_the_name_of_before_is_told_the_new_one():
    with (
        pytest.warns(FutureWarning, match=r'scenefw\.load\("reconstruction"\) now'),
        pytest.raises(ConfigError, match="seed is -1"),
    ):
        load("simstack", seed=-1)


def test_an_image_needs_intrinsics_and_a_file_to_be_there(predictor):
    with pytest.raises(InputError, match="no intrinsics of image"):
        predictor.predict(DEPTH)
    with pytest.raises(InputError, match=r"no file missing\.npz"):
        predictor.predict("missing.npz")
    with pytest.raises(InputError, match=r"^depth_scale is 'a' \(str\); expected metres per unit"):
        predictor.predict(DEPTH, CAMERA.matrix, depth_scale="a")


def test_odd_images_are_warned_of(predictor):
    few = np.where(np.arange(160) % 4 == 0, DEPTH, 0)
    with pytest.warns(UserWarning, match="only 25% of the pixels"):
        assert "only 25%" in predictor.predict(few, CAMERA).warnings[0]


texts = st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"]), max_size=8)
scalars = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | texts


PARSER = OverridesParser.create()


@given(scalars | st.lists(scalars, max_size=3))
@example("it's")
@example("a\\'b\\\\")
@example("a\\b c")
@example(["null", "true", "3", "1e5", "", "x=1", "[a,b]"])
@example("superquadrics")
def test_values_are_written_as_the_command_line_reads_them(value):
    read = PARSER.parse_override(f"key={_override_value(value)}").value()
    several = read if isinstance(value, list) else [read]
    plain = [one.text if isinstance(one, QuotedString) else one for one in several]
    assert plain == (value if isinstance(value, list) else [value])


def test_importing_is_quick_and_load_is_found():
    code = (
        "import sys, scenefw; assert 'load' in dir(scenefw);"
        "heavy = {'torch', 'numpy', 'hydra', 'numba'} & set(sys.modules);"
        "from scenefw import load; assert scenefw.load is load; sys.exit(bool(heavy))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    with pytest.raises(AttributeError, match="'scenefw' has no attribute 'laod'"):
        _ = scenefw.laod
