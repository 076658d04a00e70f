"""Representations, networks, losses, callbacks and loggers of a plugin: new files only."""

import csv
import json

import numpy as np
import pytest
import torch
from tests.test_plugins import PROJECT

from scenefw.learning.checkpoint import load_checkpoint

SMOKE = ("debug=smoke", "device=cpu", "paths.output=out")

# The height of voxels over the lowest one inside an object, as an example of a volume
REPRESENTATION = """
class Standing:
    channels = 2

    def of_scenes(self, scenes):
        inside = scenes.volumes.tsdf < 0
        return torch.cat([inside, inside.cumsum(dim=-1) > 0], dim=1)

    def to_network(self, volume, grid):
        return volume.float()

    def from_network(self, output, grid):
        return output.float().sigmoid()
"""
NETWORK = """
class Tiny(torch.nn.Module):
    training_only = ()
    latent_size = 0

    def __init__(self, width=4):
        super().__init__()
        self.outputs = {"tsdf": 1, "votes": 3}
        self.recipe = {"_target_": f"{__name__}.Tiny", "width": width}
        self.layers = torch.nn.Sequential(
            torch.nn.Conv3d(2, width, 3, padding=1), torch.nn.ReLU(), torch.nn.Conv3d(width, 4, 1)
        )

    def redraws(self, count):
        return 0

    def forward(self, batch, generator=None, *, draw=True):
        return self.predict(batch.condition)

    def predict(self, condition, latent=None):
        tsdf, votes = self.layers(condition).split([1, 3], dim=1)
        return ShapeInstancePrediction({"tsdf": tsdf, "votes": votes})
"""
LOSS = """
class Flat:
    needs_draws = False

    def __init__(self, weight=1.0):
        self.weight = weight

    def check(self, setup):
        if setup.grid.resolution != 16:
            raise ConfigError("flat needs 16 voxels")

    def __call__(self, prediction, batch):
        return prediction.tsdf.diff(dim=-1).square().mean()
"""
CALLBACK = """
class Steps(lightning.Callback):
    def __init__(self, path):
        self.path = path

    def on_train_batch_end(self, trainer, module, *_):
        with open(self.path, "a") as file:
            print(module.batches_seen, file=file)
"""
LOGGER = """
class Lines:
    def begin(self, folder, step):
        self.file = (folder / "lines.txt").open("a")

    def log(self, step, epoch, seconds, values):
        print(step, *sorted(values), file=self.file)

    def end(self):
        self.file.close()
"""
IMPORTS = """
import lightning
import torch
from scenefw.core.batches import ShapeInstancePrediction
from scenefw.core.errors import ConfigError
"""


@pytest.fixture
def plugin(tmp_path):
    """Writes a class and its option, if any, into a plugin of the folder in which scenefw runs."""

    def write(option, name, code, arguments=""):
        folder = tmp_path / "plugins" / "mine"
        package = folder / "src" / "scenefw_mine"
        package.mkdir(parents=True, exist_ok=True)
        (folder / "pyproject.toml").write_text(PROJECT.format(name="mine"))
        (package / f"{name.lower()}.py").write_text(IMPORTS + code)
        (folder / "conf").mkdir(exist_ok=True)
        if option is None:
            return
        target = f"_target_: scenefw_mine.{name.lower()}.{name}\n{arguments}"
        group = option.partition("/")[0]
        if group != "model":
            lines = "".join(f"  {line}\n" for line in target.splitlines())
            target = f"{option.partition('/')[2]}:\n{lines}"
        file = folder / "conf" / f"{option}.yaml"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f"# Written by a test\n{target}")

    return write


def rows(tmp_path):
    with (tmp_path / "out" / "losses.csv").open(newline="") as file:
        return {row["name"]: float(row["value"]) for row in csv.DictReader(file)}


@pytest.mark.exhaustive
def test_a_representation_is_trained_on_and_comes_out_by_name(plugin, scenefw, tmp_path, real_data):
    plugin("representation/standing", "Standing", REPRESENTATION)
    chosen = "representation=[tsdf,votes,standing]"
    losses = ("loss=[tsdf,votes,partial_tsdf,sample_spread,bce]", "loss.bce.target=standing")
    words = ("run=train", *SMOKE, chosen, *losses, "run.log_every=1", "run.half=false")
    done = scenefw(*words, "model.prior_share=0.5", "model.zero_share=0.0", "size.batch=4")
    assert done.returncode == 0, done.stderr[-3000:]
    assert rows(tmp_path)["train/bce"] == pytest.approx(np.log(2), abs=0.1)
    weights = tmp_path / "out" / "simstack.safetensors"
    network = load_checkpoint(weights).model
    assert network.outputs == {"tsdf": 1, "votes": 3, "standing": 2}
    head = network.decoder.others["standing"]
    image = real_data / "real" / "realsense_table" / "uois_1.npz"
    words = ("run=predict", "reconstructor=fitted", f"input={image}", f"checkpoint={weights}")
    done = scenefw(*words, chosen, "device=cpu", "paths.output=seen", "reconstructor.samples=1")
    assert done.returncode == 0, done.stderr[-3000:]
    with np.load(tmp_path / "seen" / "uois_1" / "volumes.npz") as stored:
        assert list(stored) == ["standing"]
        assert stored["standing"].shape == (2, 16, 16, 16)
        assert 0 < stored["standing"].min() < stored["standing"].max() < 1
    assert head.out_channels == 2 * 8


def test_a_representation_that_weights_lack_is_one_line(scenefw, tmp_path):
    words = ("run=evaluate", *SMOKE, "representation=[tsdf,votes,occupancy]")
    done = scenefw(*words)
    assert done.returncode == 2, done.stderr[-3000:]
    (line,) = done.stderr.strip().splitlines()
    assert "no output occupancy" in line


def test_a_network_and_a_loss_are_a_few_lines(plugin, scenefw, tmp_path):
    plugin("model/tiny", "Tiny", NETWORK, "width: 3\n")
    plugin("loss/flat", "Flat", LOSS, "weight: 0.5\n")
    words = ("run=train", *SMOKE, "model=tiny", "loss=[tsdf,votes,flat]", "run.log_every=1")
    done = scenefw(*words)
    assert done.returncode == 0, done.stderr[-3000:]
    assert json.loads((tmp_path / "out" / "metrics.json").read_text())["train/steps"] == 2
    found = rows(tmp_path)
    total = found["train/tsdf"] + 0.4 * found["train/votes"] + 0.5 * found["train/flat"]
    assert found["train/total"] == pytest.approx(total, rel=1e-4)
    done = scenefw(*words, "size.resolution=8", "paths.output=other")
    assert done.returncode == 2
    assert "flat needs 16 voxels" in done.stderr


def test_a_callback_and_a_logger_are_a_setting_each(plugin, scenefw, tmp_path):
    plugin(None, "Steps", CALLBACK)
    plugin(None, "Lines", LOGGER)
    words = ["+callback.steps._target_=scenefw_mine.steps.Steps", "logger.csv=null"]
    words += ["+callback.steps.path=${paths.output}/steps.txt", "callback.progress=null"]
    words += ["+logger.lines._target_=scenefw_mine.lines.Lines", "logger.tensorboard=null"]
    done = scenefw("run=train", *SMOKE, *words, "run.log_every=1")
    assert done.returncode == 0, done.stderr[-3000:]
    assert (tmp_path / "out" / "steps.txt").read_text() == "1\n2\n"
    lines = (tmp_path / "out" / "training" / "lines.txt").read_text().splitlines()
    assert [line.split()[0] for line in lines] == ["1", "2", "2"]
    assert "train/total" in lines[0]
    assert "val/iou" in lines[-1]
    assert not (tmp_path / "out" / "losses.csv").exists()


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["experiment=label_views", "loss=[tsdf]"], "tsdf"),
        (["experiment=simstack", "loss=[tsdf,bce]"], "the loss bce compares occupancy"),
        (["experiment=simstack", "representation=[tsdf]"], "the loss votes compares votes"),
        (["experiment=simstack", "model.outputs={tsdf:1}"], "the network gives tsdf"),
    ],
)
def test_parts_that_do_not_fit_are_one_line_before_the_work(scenefw, tmp_path, words, expected):
    done = scenefw(*words, "run=train", *SMOKE)
    assert done.returncode == 2, done.stderr[-3000:]
    (line,) = done.stderr.strip().splitlines()
    assert expected in line
    assert not (tmp_path / "out" / "training").exists()


def test_the_network_is_trained_on_what_its_outputs_mean(plugin, scenefw, tmp_path):
    """Gradients of the loss on a plugin's volume reach its head alone of all heads."""
    torch.manual_seed(0)
    from scenefw.core.batches import ShapeInstanceBatch
    from scenefw.losses.binary_cross_entropy import BinaryCrossEntropy
    from scenefw.models.shape_instance_vae import ShapeInstanceVAE

    network = ShapeInstanceVAE(8, outputs={"tsdf": 1, "votes": 3, "mine": 2}, prior_share=0.9)
    size = (8, 8, 8)
    targets = {n: torch.rand(2, c, *size).round() for n, c in network.outputs.items()}
    batch = ShapeInstanceBatch(torch.rand(2, 2, *size), targets)
    found = network(batch, torch.Generator().manual_seed(0))
    BinaryCrossEntropy(target="mine")(found, batch).backward()
    assert network.decoder.others["mine"].weight.grad.any()
    assert network.decoder.tsdf.weight.grad is None
    assert found.redrawn.volumes["mine"].shape == (2, 2, *size)
