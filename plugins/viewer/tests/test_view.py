import socket
import sys
import threading

import numpy as np
import pytest
from tests.unit.perception.pipelines import KnownBoxes, pipeline_of
from tests.unit.perception.synthetic import camera_at, frame_of

from scenefw.core.errors import ConfigError, InputError, MissingDependencyError
from scenefw.core.types import GridSpec
from scenefw_viewer.view import View

CAMERA = camera_at(eye=(0.0, -0.85, 0.6), size=(160, 120))


@pytest.fixture
def pipeline():
    return pipeline_of(KnownBoxes(GridSpec(resolution=32)), samples=2)


def save(path):
    frame = frame_of(CAMERA)
    np.savez(path, depth=frame.depth, K=CAMERA.matrix, instances=frame.labels)
    return path


def test_it_ends_after_its_time_and_says_where(tmp_path, pipeline, capsys):
    pytest.importorskip("viser")
    image = save(tmp_path / "boxes.npz")
    figures = View(image, pipeline, tmp_path / "out", port=0, seconds=0.1).run()
    assert figures == {"images": 1}
    first, last = capsys.readouterr().out.splitlines()
    assert first.startswith("http://127.0.0.1:")
    assert last == f"viewer ended; exports are in {tmp_path / 'out'}"


def test_ctrl_c_ends_it_with_one_line_and_frees_the_port(tmp_path, pipeline, capsys, monkeypatch):
    pytest.importorskip("viser")
    ports = []

    class Interrupted(threading.Event):
        def wait(self, timeout=None):
            if sys._getframe(1).f_globals["__name__"] != View.__module__:
                return super().wait(timeout)
            ports.append(int(capsys.readouterr().out.split()[0].rsplit(":", 1)[1]))
            raise KeyboardInterrupt

    monkeypatch.setattr(threading, "Event", Interrupted)
    View(save(tmp_path / "boxes.npz"), pipeline, tmp_path, port=0, host="127.0.0.1").run()
    assert capsys.readouterr().out.splitlines() == [f"viewer ended; exports are in {tmp_path}"]
    with socket.socket() as after:
        after.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        after.bind(("127.0.0.1", ports[0]))


def test_a_port_in_use_is_said_before_the_work(tmp_path, pipeline):
    pytest.importorskip("viser")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(ConfigError, match=r"in use.*run\.port="):
            View(save(tmp_path / "boxes.npz"), pipeline, tmp_path, port=port).run()
    assert pipeline.completion.requests == []


def test_without_viser_the_install_line_is_said(tmp_path, pipeline, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'scenefw\[viewer"):
        View(save(tmp_path / "boxes.npz"), pipeline, tmp_path).run()


@pytest.mark.parametrize("wrong", [{"input": None}, {"seconds": 0}, {"depth_scale": -1}])
def test_wrong_settings_are_one_line(tmp_path, pipeline, wrong):
    with pytest.raises(ConfigError, match=r"input=PATH|(run\.seconds|depth_scale) = "):
        View(**{"input": tmp_path, "pipeline": pipeline, **wrong})


def test_missing_images_are_said(tmp_path, pipeline):
    pytest.importorskip("viser")
    with pytest.raises(InputError, match="no file or folder"):
        View(tmp_path / "none.npz", pipeline, tmp_path, port=0).run()


def test_a_prediction_keeps_image_truth_and_partial_volume(tmp_path, pipeline):
    known = View(tmp_path, pipeline, tmp_path / "out").predict(save(tmp_path / "boxes.npz"))
    assert len(known.scenes) == 2
    assert known.partial.shape == (32, 32, 32)
    assert known.frame.labels.max() == 2
    assert [item.id for item in known.scenes[0].objects] == [1, 2]
