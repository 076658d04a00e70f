"""Services over real connections, with a pipeline that knows its boxes, and requests to them."""

import contextlib
import io
import json
import threading
import time

import numpy as np
import pytest
from PIL import Image
from tests.unit.perception.obstacles import OBSTACLES
from tests.unit.perception.pipelines import KnownBoxes, pipeline_of
from tests.unit.perception.synthetic import camera_at, frame_of

from scenefw.core.types import GridSpec
from scenefw.perception.observation.doctor import Doctor
from scenefw.perception.observation.floor import FloorFinder
from scenefw.perception.observation.workspace import WorkspaceFinder
from scenefw_doctor.examination import Examiner
from scenefw_serving.image_request import Predictions
from scenefw_serving.limits import Limits
from scenefw_serving.routes import Diagnose, NextView, Reconstruct, Settle
from scenefw_serving.work import Work

httpx = pytest.importorskip("httpx", reason="needs httpx")
pytest.importorskip("fastapi", reason="needs fastapi (pip install 'scenefw[serve]')")

CAMERA = camera_at(eye=(0.0, -0.85, 0.6), size=(160, 120))
FRAME = frame_of(CAMERA)
GRID = GridSpec(resolution=32)


class Raised:
    """Settles by lifting nothing: says that it was asked."""

    def settle(self, scenes):
        from dataclasses import replace

        return [replace(s, details={**s.details, "settled": {"objects": []}}) for s in scenes]


class Slow:
    """Waits until it may go on."""

    path, summary, formats = "/slow", "Waits", {"json": "application/json"}

    def __init__(self):
        self.begun, self.go, self.names = threading.Semaphore(0), threading.Event(), []

    def answer(self, image, form):
        self.names.append(image.frame.name)
        self.begun.release()
        assert self.go.wait(30)
        return {"name": image.frame.name}


def routes():
    examiner = Examiner(FloorFinder(), WorkspaceFinder(OBSTACLES), Doctor(), GRID)
    return {
        "reconstruct": Reconstruct(),
        "settle": Settle(Raised()),
        "doctor": Diagnose(examiner),
        "next_view": NextView(count=4, best=2),
        "slow": Slow(),
    }


@contextlib.contextmanager
def serving(limits=None, pipeline=None, own_routes=None):
    """A service in this process: a client of it, and the service."""
    from scenefw_serving.application import Service
    from scenefw_serving.server import bound, listening

    limits = limits or Limits()
    pipeline = pipeline or pipeline_of(KnownBoxes(GRID), samples=2)
    work = Work()
    hosts = ("127.0.0.1", "localhost")
    service = Service(own_routes or routes(), Predictions(pipeline), limits, work, hosts)
    taken = bound("127.0.0.1", 0)
    worker = threading.Thread(target=_work, args=(work,))
    worker.start()
    base = f"http://127.0.0.1:{taken.getsockname()[1]}"
    try:
        with (
            listening(service.application(), taken, limits),
            httpx.Client(base_url=base, timeout=300) as client,
        ):
            yield client, service
    finally:
        work.submit(_interrupt)
        worker.join()


def _work(work):
    with contextlib.suppress(KeyboardInterrupt):
        work.run()


def _interrupt():
    raise KeyboardInterrupt


def npz(**changes):
    content = {"depth": FRAME.depth, "K": CAMERA.matrix} | changes
    file = io.BytesIO()
    np.savez_compressed(file, **content)
    return file.getvalue()


def png(array):
    file = io.BytesIO()
    Image.fromarray(array).save(file, "PNG")
    return file.getvalue()


def depth_png():
    return png(np.rint(FRAME.depth * 1000).astype(np.uint16))


def intrinsics():
    names = ("fx", "fy", "cx", "cy", "width", "height")
    return json.dumps({name: getattr(CAMERA, name) for name in names}).encode()


def error_of(answer):
    (key,) = answer.json()
    assert key == "error"
    line = answer.json()["error"]
    assert "\n" not in line
    return line


def until(condition):
    end = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)
