"""Components of a plugin that `test_training_plugins` hasn't: each a class and its option."""

import json

import pytest
from tests.test_plugins import PROJECT

SMOKE = ("debug=smoke", "device=cpu")
FILES = {
    "segments.py": '''
import numpy as np
from scipy import ndimage

from scenefw.core.types import Int32
from scenefw.perception.observation.observation import Observation


class Blobs:
    """Pixels above the floor that touch."""

    def __init__(self, lowest: float) -> None:
        self.lowest = lowest

    def segment(self, view: Observation) -> Int32:
        blobs, _ = ndimage.label(view.heights > self.lowest)
        blobs[np.bincount(blobs.ravel())[blobs] < 500] = 0
        return np.unique(blobs, return_inverse=True)[1].reshape(blobs.shape).astype(np.int32)
''',
    "instances.py": '''
import torch
from torch import Tensor

from scenefw.core.types import GridSpec


class Largest:
    """One object: what lies in the same column as the highest matter."""

    def extract(self, tsdf: Tensor, votes: Tensor, grid: GridSpec) -> tuple[Tensor, Tensor]:
        inside = tsdf < 0
        x, y, _ = max(inside.nonzero().tolist(), key=lambda voxel: voxel[2])
        column = torch.zeros_like(inside)
        column[x - 1 : x + 2, y - 1 : y + 2] = inside[x - 1 : x + 2, y - 1 : y + 2]
        middle = column.nonzero().float().mean(dim=0, keepdim=True)
        return column.int(), torch.as_tensor(grid.to_world(middle.numpy())).float()
''',
    "images.py": '''
import torch
from torch import Tensor

from scenefw.core.batches import CameraBatch
from scenefw.core.protocols import SceneBatch
from scenefw.core.types import GridSpec


class Afloat:
    """Objects as their shapes are, without a floor."""

    def render(self, tsdf: Tensor, grid: GridSpec, cameras: CameraBatch) -> Tensor:
        raise NotImplementedError("scenes alone")

    def render_scenes(self, scenes: SceneBatch, cameras: CameraBatch) -> Tensor:
        return scenes.depth(cameras)


class Steps:
    """Depth in steps."""

    def __init__(self, step: float) -> None:
        self.step = step

    def apply(self, depth: Tensor, cameras: CameraBatch, seeds: Tensor) -> Tensor:
        return (depth / self.step).ceil() * self.step
''',
    "files.py": '''
from collections.abc import Sequence
from pathlib import Path

from scenefw.core.files import write_text
from scenefw.core.types import SceneEstimate


class Centres:
    """A line for each object."""

    suffix = ".xyz"

    def write(self, path: Path, estimate: SceneEstimate, colours: Sequence[object]) -> None:
        rows = (item.pose.position.tolist() for item in estimate.objects)
        write_text(path, "".join(f"{x} {y} {z}\\\\n" for x, y, z in rows))
''',
    "heights.py": """
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from scenefw.core.measures import Measure
from scenefw.core.protocols import Track
from scenefw.data.batches.stacks import StackScenes
from scenefw.report.blocks import Drawing, Section
from scenefw.report.figures import to_svg
from scenefw.report.presentation import figure_table


@dataclass(frozen=True)
class Heights:
    heights: Sequence[float]

    @property
    def figures(self) -> Mapping[str, float]:
        return {"highest": max(self.heights)}

    @property
    def measures(self) -> Mapping[str, Measure]:
        return {"highest": Measure("highest centre", "of all scenes", "m", 3)}


class HowHigh:
    def __init__(self, scenes: StackScenes) -> None:
        self.scenes = scenes

    def run(self, track: Track = lambda items, _: items) -> Heights:
        numbers = track(range(len(self.scenes)), "scenes")
        scenes = (self.scenes.parameters([number]) for number in numbers)
        return Heights([float(one.positions[one.present][:, 2].max()) for one in scenes])


class Drawn:
    def sections(self, result: Heights, folder: Path) -> Sequence[Section]:
        figure = Figure()
        figure.add_subplot(title="a figure of its own").plot(result.heights)
        return [Section("How high", (figure_table(result), Drawing(to_svg(figure))))]
""",
}
OPTIONS = {
    "segmentation/blobs": "_target_: scenefw_mine.segments.Blobs\nlowest: 0.02",
    "postprocessing/largest": "_target_: scenefw_mine.instances.Largest",
    "renderer/afloat": "_target_: scenefw_mine.images.Afloat",
    "noise/steps": "steps:\n  _target_: scenefw_mine.images.Steps\n  step: 0.01",
    "export/centres": "centres:\n  _target_: scenefw_mine.files.Centres",
    "presentation/drawn": "_target_: scenefw_mine.heights.Drawn",
    "evaluation/how_high": """defaults:
  - override /presentation@_global_.presentation: drawn
_target_: scenefw_mine.heights.HowHigh
scenes:
  _target_: scenefw.data.batches.stacks.StackScenes
  path: ${dataset.path}
  split: test
  limit: ${size.test_scenes}""",
}


@pytest.fixture
def mine(tmp_path):
    """Writes the plugin into the folder in which scenefw runs."""
    folder = tmp_path / "plugins" / "mine"
    (package := folder / "src" / "scenefw_mine").mkdir(parents=True)
    (folder / "pyproject.toml").write_text(PROJECT.format(name="mine"))
    for name, code in FILES.items():
        (package / name).write_text(code.replace("\\\\n", "\\n"))
    for option, text in OPTIONS.items():
        (file := folder / "conf" / f"{option}.yaml").parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f"# Written by a test\n{text}\n")
    return tmp_path


def test_images_are_rendered_and_disturbed_by_a_plugin(scenefw, mine):
    done = scenefw("run=train", *SMOKE, "renderer=afloat", "noise=[steps]", "paths.output=out")
    assert done.returncode == 0, done.stderr[-3000:]
    assert json.loads((mine / "out" / "metrics.json").read_text())["train/steps"] == 2


def test_an_evaluation_is_shown_by_a_figure_of_its_own(scenefw, mine):
    done = scenefw("run=evaluate", *SMOKE, "evaluation=how_high", "paths.output=out")
    assert done.returncode == 0, done.stderr[-3000:]
    assert 0.02 < json.loads((mine / "out" / "metrics.json").read_text())["highest"] < 0.6
    page = (mine / "out" / "report.html").read_text()
    assert "a figure of its own" in page
    assert "of all scenes" in page


EXTRACTOR = "postprocessing@reconstructor.completion.extractor"


@pytest.mark.parametrize("chosen", ["segmentation=blobs", f"{EXTRACTOR}=largest"])
def test_a_scene_is_taken_apart_and_written_by_a_plugin(scenefw, mine, real_data, chosen):
    image = real_data / "real" / "realsense_table" / "uois_1.npz"
    method = "set_extents" if chosen.startswith("segmentation") else "network"
    words = ("run=predict", f"input={image}", f"reconstructor={method}", "export=[centres]")
    done = scenefw(*words, chosen, *SMOKE, "run.overview=false", "paths.output=out")
    assert done.returncode == 0, done.stderr[-3000:]
    lines = (mine / "out" / "uois_1" / "scene.xyz").read_text().splitlines()
    objects = json.loads((mine / "out" / "uois_1" / "scene.json").read_text())["objects"]
    assert len(lines) == len(objects)
    assert len(objects) > 3 if method == "set_extents" else len(objects) == 1
