"""The run that serves: where it answers, how it begins and ends."""

import socket
import sys

import pytest
from plugins.serving.tests.services import GRID, routes
from tests.unit.perception.pipelines import KnownBoxes, pipeline_of

from scenefw.core.errors import ConfigError, InputError, MissingDependencyError
from scenefw_serving.limits import Limits
from scenefw_serving.routes import Reconstruct
from scenefw_serving.task import Serve


def task(**changes):
    pipeline = pipeline_of(KnownBoxes(GRID), samples=1)
    return Serve(**{"pipeline": pipeline, "routes": routes(), "port": 0, "seconds": 0.2, **changes})


def test_a_run_says_where_it_answers_and_ends(capsys):
    assert task().run() == {"answered": 0}
    first, last = capsys.readouterr().out.splitlines()
    assert first.startswith("http://127.0.0.1:")
    paths = "/reconstruct, /settle, /doctor, /next_view, /slow"
    assert first.endswith(f"answers POST {paths}; Ctrl-C ends it")
    assert last == "service ended; requests answered: 0"


def test_it_is_warm_before_the_first_request():
    served = task()
    served.run()
    assert len(served.predictions.pipeline.completion.requests) == 1


def test_a_port_in_use_is_said_before_the_work():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        served = task(port=taken.getsockname()[1])
        with pytest.raises(ConfigError, match=r"in use.*run\.port="):
            served.run()
    assert served.predictions.pipeline.completion.requests == []


@pytest.mark.parametrize("library", ["fastapi", "uvicorn", "python_multipart"])
def test_without_a_library_the_install_line_is_said(monkeypatch, library):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'scenefw\[serve\]'"):
        task().run()


def test_wrong_settings_are_one_line():
    with pytest.raises(ConfigError, match=r"run\.seconds"):
        task(seconds=0)
    with pytest.raises(ConfigError, match="queue = 0"):
        Limits(queue=0)
    with pytest.raises(ConfigError, match="one path"):
        task(routes={"a": Reconstruct(), "b": Reconstruct()})
    with pytest.raises(InputError):
        Reconstruct().answer(_Nothing(), "json")


class _Nothing:
    def scenes(self):
        raise InputError("nothing")
