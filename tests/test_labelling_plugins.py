"""A strategy, a label source and key frames of a plugin, written to the protocols of core alone."""

import json

import numpy as np
import pytest
from tests.test_plugins import PROJECT
from tests.unit.tasks.recordings import CLASSES, frames

from scenefw.data.files.height_maps import load_map
from scenefw.data.files.sequences import write_sequence

STRATEGY = '''
"""Gives the whole map the class that most pixels of labelled views have."""

import numpy as np

from scenefw.core.height_maps import HeightMap
from scenefw.core.labelling_protocols import (
    HeightMapping, KeyFrames, LabelSource, RunningLabelling, States
)
from scenefw.core.labels import FROM_VIEWS, labelled
from scenefw.core.types import Frame


class Commonest:
    def __init__(self, heights: HeightMapping, source: LabelSource, key_frames: KeyFrames) -> None:
        self.heights, self.source, self.key_frames = heights, source, key_frames

    @property
    def classes(self) -> tuple[str, ...]:
        return tuple(self.source.classes)

    def begin(
        self, previous: HeightMap | None = None, states: States | None = None
    ) -> RunningLabelling:
        return Running(self, previous, states or {})


class Running:
    def __init__(self, strategy: Commonest, previous: HeightMap | None, states: States) -> None:
        self.strategy = strategy
        self.heights = strategy.heights.begin(previous, states.get("heights"))
        self.schedule = strategy.key_frames.begin(states.get("key_frames"))
        counts = np.zeros(len(strategy.classes), np.int64)
        self.counts = states.get("commonest", {}).get("counts", counts)

    def add(self, frame: Frame) -> None:
        self.heights.add(frame)
        if self.schedule.takes(frame):
            labels = self.strategy.source.label(frame).argmax(axis=0)
            self.counts = self.counts + np.bincount(labels.ravel(), minlength=len(self.counts))

    def height_map(self) -> HeightMap:
        found = self.heights.height_map()
        shares = self.counts / self.counts.sum()
        shape = (len(shares), *found.grid.shape)
        uniform = np.broadcast_to(shares[:, None, None], shape).astype(np.float32)
        return labelled(found, uniform, self.strategy.classes, FROM_VIEWS)

    def states(self) -> States:
        return {
            "heights": self.heights.state(),
            "key_frames": self.schedule.state(),
            "commonest": {"counts": self.counts},
        }
'''
SOURCE = '''
"""Labels pixels by their column."""

from collections.abc import Sequence

import numpy as np

from scenefw.core.types import Float32, Frame


class Halves:
    def __init__(self, classes: Sequence[str], left: str, share: float = 0.75) -> None:
        self.classes, self.left, self.share = tuple(classes), list(classes).index(left), share

    def label(self, frame: Frame) -> Float32:
        labels = np.zeros(frame.depth.shape, int)
        labels[:, : int(self.share * labels.shape[1])] = self.left
        return np.stack([labels == i for i in range(len(self.classes))]).astype(np.float32)
'''
SCHEDULE = '''
"""Frames with even names; there is nothing to save."""

from scenefw.core.labelling_protocols import RunningKeyFrames, State
from scenefw.core.types import Frame


class EvenNames:
    def begin(self, state: State | None = None) -> RunningKeyFrames:
        return self

    def takes(self, frame: Frame) -> bool:
        return int(frame.name[-1]) % 2 == 0

    def state(self) -> State:
        return {}
'''
FILES = {
    "conf/labelling/commonest.yaml": """
# The class that most pixels have
commonest:
  _target_: scenefw_mine.commonest.Commonest
  heights: ${heights}
  source: ${label_source}
  key_frames: ${key_frames}
""",
    "conf/label_source/halves.yaml": """
# Labels pixels by their column
_target_: scenefw_mine.halves.Halves
classes: ${classes}
left: keyboard
share: 0.75
""",
    "conf/key_frames/even_names.yaml": """
# Frames with even names
_target_: scenefw_mine.even_names.EvenNames
""",
    "src/scenefw_mine/commonest.py": STRATEGY,
    "src/scenefw_mine/halves.py": SOURCE,
    "src/scenefw_mine/even_names.py": SCHEDULE,
    "src/scenefw_mine/__init__.py": '"""A plugin."""\n',
    "pyproject.toml": PROJECT.format(name="mine"),
}
MINE = ["label_source=halves", "key_frames=even_names", "debug=smoke", "device=cpu"]


@pytest.fixture
def plugin(tmp_path):
    for name, text in FILES.items():
        (path := tmp_path / "plugins" / "mine" / name).parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text.lstrip())


@pytest.mark.usefixtures("plugin")
def test_parts_of_a_plugin_label_a_recording_and_resume(scenefw, tmp_path):
    recording = write_sequence(tmp_path / "in", frames(), CLASSES)
    classes = f"classes=[{','.join(CLASSES)}]"
    label = ["run=label", "labelling=commonest", f"input={recording}", classes, *MINE]
    first = scenefw(*label, "run.frames=3", "paths.output=first")
    assert first.returncode == 0, first.stderr
    rest = scenefw(*label, "run.resume=first/map.npz", "run.start=3", "paths.output=rest")
    assert rest.returncode == 0, rest.stderr
    saved = load_map(tmp_path / "rest" / "map.npz")
    assert set(np.unique(saved.height_map.labels)) == {-1, CLASSES.index("keyboard")}
    pixels = 3 * 80 * 60  # of frames 0, 2 and 4
    expected = [pixels // 4, 0, pixels * 3 // 4, 0]
    np.testing.assert_array_equal(saved.states["commonest"]["counts"], expected)
    assert set(saved.states) == {"recording", "heights", "commonest"}


@pytest.mark.usefixtures("plugin")
def test_a_strategy_of_a_plugin_is_compared_with_others(scenefw, tmp_path):
    chosen = "labelling=[map_based,commonest]"
    done = scenefw("experiment=view_vs_map", chosen, *MINE, "paths.output=out")
    assert done.returncode == 0, done.stderr
    figures = json.loads((tmp_path / "out" / "metrics.json").read_text())
    for strategy in ("map_based", "commonest"):
        assert 0 <= figures[f"{strategy}/miou"] <= 1
    assert figures["commonest/coverage"] == figures["map_based/coverage"] > 0
