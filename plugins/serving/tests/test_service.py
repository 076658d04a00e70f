"""The service over real connections, with a pipeline that knows its boxes."""

import contextlib
import gc
import io
import json
import socket
import sys
import threading
import time
import zipfile
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import trimesh
from PIL import Image
from tests.unit.perception.obstacles import OBSTACLES
from tests.unit.perception.pipelines import KnownBoxes, pipeline_of
from tests.unit.perception.synthetic import camera_at, frame_of

from scenefw.core.errors import ConfigError, InputError, MissingDependencyError
from scenefw.core.types import GridSpec, SceneEstimate
from scenefw.perception.observation.doctor import Doctor
from scenefw.perception.observation.examination import Examiner
from scenefw.perception.observation.floor import FloorFinder
from scenefw.perception.observation.workspace import WorkspaceFinder
from scenefw_serving.image_request import Predictions
from scenefw_serving.limits import Limits
from scenefw_serving.routes import Diagnose, NextView, Reconstruct, Settle
from scenefw_serving.task import Serve
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


@pytest.fixture(scope="module")
def service():
    with serving() as pair:
        yield pair


@pytest.fixture
def client(service):
    return service[0]


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


def test_an_npz_gives_the_scene_that_a_prediction_gives(client):
    answer = client.post("/reconstruct", content=npz())
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "application/json"
    scene = answer.json()
    direct = pipeline_of(KnownBoxes(GRID), samples=2)(FRAME)[0]
    assert [item["id"] for item in scene["objects"]] == [1, 2]
    centres = [item["centre"] for item in scene["objects"]]
    np.testing.assert_allclose(centres, [o.pose.position for o in direct.objects], atol=1e-4)


def test_a_png_with_intrinsics_and_colour_gives_the_same(client):
    files = {
        "depth": ("table.png", depth_png()),
        "intrinsics": ("camera.json", intrinsics()),
        "colour": ("table.jpg", png(np.full((120, 160, 3), 99, np.uint8))),
    }
    scene = client.post("/reconstruct", files=files).json()
    assert scene["name"] == "table"
    other = client.post("/reconstruct", content=npz()).json()
    for item, same in zip(scene["objects"], other["objects"], strict=True):
        np.testing.assert_allclose(item["centre"], same["centre"], atol=2e-3)


def test_the_scene_comes_as_glb_masks_and_zip(client):
    glb = client.post("/reconstruct?format=glb", content=npz())
    assert glb.headers["content-type"] == "model/gltf-binary"
    meshes = trimesh.load(io.BytesIO(glb.content), file_type="glb").geometry
    assert sorted(meshes) == ["object_01", "object_02"]
    masks = client.post("/reconstruct?format=masks", content=npz())
    ids = np.array(Image.open(io.BytesIO(masks.content)))
    assert ids.shape == (120, 160)
    assert set(np.unique(ids)) == {0, 1, 2}
    packed = client.post("/reconstruct?format=zip", content=npz())
    names = zipfile.ZipFile(io.BytesIO(packed.content)).namelist()
    files = {"scene.json", "scene.glb", "masks.png", "object_01.ply", "object_02.ply"}
    assert files | {f"hypothesis_2/{name}" for name in files} <= set(names)


def test_one_image_is_predicted_once(service):
    client, running = service
    completion = running.predictions.pipeline.completion
    image = npz(depth=FRAME.depth + np.float32(1e-4))
    before = len(completion.requests)
    for form in ("json", "glb", "masks", "zip"):
        assert client.post(f"/reconstruct?format={form}", content=image).status_code == 200
    assert len(completion.requests) == before + 1


def test_remembered_images_are_bounded(service):
    predictions = service[1].predictions
    for shift in range(6):
        service[0].post("/reconstruct", content=npz(depth=FRAME.depth + np.float32(1e-3 * shift)))
    assert len(predictions._scenes) <= predictions.remembered


def test_another_hypothesis_can_be_asked_for(client):
    answer = client.post("/reconstruct?sample=1", content=npz())
    assert answer.status_code == 200
    refused = client.post("/reconstruct?sample=2", content=npz())
    assert refused.status_code == 422
    assert error_of(refused) == "there is no sample 2; give one of 0 to 1"


def test_doctor_and_settle_answer(client):
    told = client.post("/doctor", content=npz()).json()
    assert told["usable"]
    assert {"unit", "floor", "tilt"} <= {check["name"] for check in told["checks"]}
    odd = client.post("/doctor", content=npz(depth=1000 * FRAME.depth))
    assert odd.status_code in (200, 422)
    assert "settled" in client.post("/settle", content=npz()).json()
    views = client.post("/next_view", content=npz()).json()["views"]
    assert [set(view) for view in views] == [{"T_world_camera", "score"}] * 2


def test_answers_are_in_the_base_of_a_robot_if_the_cameras_pose_is_said(client):
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[:3, 3] = 0.3, 0.1, 1.2
    files = {"depth": ("a.npz", npz()), "camera_pose": ("pose.json", str(pose.tolist()).encode())}
    here = client.post("/reconstruct", files={"depth": ("a.npz", npz())}).json()
    base = client.post("/reconstruct", files=files).json()
    assert base["camera"]["T_world_camera"] == pose.tolist()
    motion = pose @ np.linalg.inv(here["camera"]["T_world_camera"])
    np.testing.assert_allclose(base["T_base_floor"], motion, atol=1e-9)
    for before, after in zip(here["objects"], base["objects"], strict=True):
        expected = motion @ [*before["centre"], 1.0]
        np.testing.assert_allclose(after["centre"], expected[:3], atol=1e-9)
    wrong = client.post("/reconstruct", files={**files, "camera_pose": b"[1, 2]"})
    assert wrong.status_code == 422
    assert "camera_pose" in error_of(wrong)


def test_masks_with_scores_say_which_object_a_pixel_shows(client):
    ids = FRAME.labels
    masks = np.stack([ids > 0, ids == 2, ids == 1])
    image = npz(masks=masks, scores=[0.2, 0.9, 0.8])
    scene = client.post("/reconstruct", content=image).json()
    plain = client.post("/reconstruct", content=npz()).json()
    assert len(scene["objects"]) == len(plain["objects"])
    files = [
        ("masks", (f"{i}.png", png(mask.astype(np.uint8) * 255))) for i, mask in enumerate(masks)
    ]
    files += [
        ("depth", ("table.png", depth_png())),
        ("intrinsics", ("camera.json", intrinsics())),
        ("scores", ("scores.json", b"[0.2, 0.9, 0.8]")),
    ]
    assert client.post("/reconstruct", files=files).status_code == 200


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ({"depth": ("a.png", depth_png())}, "no intrinsics"),
        ({"intrinsics": ("a.json", intrinsics())}, "no depth image"),
        ({"depth": ("a.npz", npz()), "dept": b"x"}, "no field dept"),
        ({"depth": ("a.txt", b"hello")}, "depth is no .npz, .npy or .png"),
        ({"depth": ("a.npz", b"PK\x03\x04broken")}, "cannot read a.npz"),
        ({"depth": ("a.npz", npz(depth=FRAME.depth * 0))}, "no measurements"),
        ({"depth": ("a.npz", npz(depth=FRAME.depth[0]))}, "shape"),
        ({"depth": ("a.npz", npz(depth=FRAME.depth * 1000))}, "millimetres given as metres"),
        ({"depth": ("a.npz", npz()), "scores": b"[1]"}, "no masks"),
        ({"depth": ("a.npz", npz(masks=np.ones((2, 120, 160)), scores=[1]))}, "scores have shape"),
        ({"depth": ("a.npz", npz(masks=np.ones((2, 12, 16))))}, "same size"),
        (
            {"depth": ("a.png", depth_png()), "intrinsics": ("a.json", b"{}")},
            "fx",
        ),
    ],
)
def test_unusable_images_are_422_in_one_line(client, files, words):
    answer = client.post("/reconstruct", files=files)
    assert answer.status_code == 422
    assert words in error_of(answer)
    assert "/tmp" not in error_of(answer)


def test_colour_of_another_size_is_refused(client):
    files = {
        "depth": ("table.png", depth_png()),
        "intrinsics": ("camera.json", intrinsics()),
        "colour": ("table.png", png(np.zeros((60, 80, 3), np.uint8))),
    }
    answer = client.post("/reconstruct", files=files)
    assert answer.status_code == 422
    assert "80 x 60 pixels, depth 160 x 120" in error_of(answer)


@pytest.mark.parametrize(("name", "key"), [("colour", "rgb"), ("masks", "masks")])
def test_what_comes_twice_is_refused(client, name, key):
    picture = np.zeros((*FRAME.depth.shape, 3), np.uint8)
    array = picture if key == "rgb" else picture[None, ..., 0]
    files = {"depth": ("table.npz", npz(**{key: array})), name: ("other.png", png(picture))}
    answer = client.post("/reconstruct", files=files)
    assert answer.status_code == 422
    assert f"{name} comes twice" in error_of(answer)


def test_parameters_that_fit_nothing_are_one_line(client):
    for words in ("format=stl", "sample=many", "depth_scale=-1"):
        answer = client.post(f"/reconstruct?{words}", content=npz())
        assert answer.status_code == 422
        assert words.split("=", maxsplit=1)[0] in error_of(answer)
    assert client.post("/nowhere").status_code == 404
    assert client.get("/reconstruct").status_code == 405


def test_pages_of_other_servers_are_refused(client):
    assert client.get("/health", headers={"host": "evil.example"}).status_code == 403
    answer = client.post("/doctor", content=npz(), headers={"origin": "http://evil.example"})
    assert answer.status_code == 403
    own = {"origin": str(client.base_url).rstrip("/")}
    assert client.post("/doctor", content=npz(), headers=own).status_code == 200


def test_openapi_and_the_page_tell_all_routes(client):
    told = client.get("/openapi.json").json()
    paths = {"/reconstruct", "/settle", "/doctor", "/next_view", "/slow", "/health"}
    assert paths == set(told["paths"])
    page = client.get("/").text
    assert "POST /reconstruct" in page
    assert "http" not in page.replace("<!doctype html>", "")  # nothing is fetched from elsewhere


def test_what_is_too_large_is_refused_unread():
    with serving(Limits(body=0.2, pixels=0.02, masks=2)) as (client, service):
        answer = client.post("/reconstruct", content=b"PK\x03\x04" + bytes(300_000))
        assert answer.status_code == 413
        assert "0.2 MB" in error_of(answer)

        def chunks():
            yield b"PK\x03\x04"
            for _ in range(100):
                yield bytes(10_000)

        unsaid = client.post("/reconstruct", content=chunks())  # no Content-Length
        assert unsaid.status_code == 413
        wide = client.post("/reconstruct", content=npz(depth=np.ones((200, 200))))
        assert wide.status_code == 413
        bomb = client.post("/reconstruct", content=npz(depth=np.zeros((1000, 1000))))
        assert bomb.status_code == 413
        assert "unpacks to" in error_of(bomb)
        masks = client.post("/reconstruct", content=npz(masks=np.ones((3, 120, 160), bool)))
        assert masks.status_code == 413
        picture = {"depth": ("a.png", png(np.ones((200, 200), np.uint16))), "intrinsics": b"{}"}
        assert client.post("/reconstruct", files=picture).status_code == 413
        assert client.post("/reconstruct", content=npz()).status_code == 200
        assert service.waiting == 0


def test_twenty_clients_at_once_get_their_own_answers():
    quick = Slow()
    quick.go.set()
    with serving(Limits(queue=24), own_routes={"slow": quick}) as (client, service):
        body = npz()

        def ask(number):
            with httpx.Client(base_url=client.base_url, timeout=300) as own:
                return own.post("/slow", files={"depth": (f"image{number}.npz", body)})

        with ThreadPoolExecutor(20) as pool:
            answers = list(pool.map(ask, range(20)))
        assert [answer.status_code for answer in answers] == [200] * 20
        assert [answer.json()["name"] for answer in answers] == [f"image{i}" for i in range(20)]
        until(lambda: service.waiting == 0)
        assert service.answered == 20


def test_a_full_queue_is_said_at_once_and_empties():
    slow = Slow()
    with serving(Limits(queue=2), own_routes={"slow": slow}) as (client, service):
        with ThreadPoolExecutor(2) as pool:
            first = [pool.submit(client.post, "/slow", content=npz()) for _ in range(2)]
            assert slow.begun.acquire(timeout=30)
            until(lambda: service.waiting == 2)
            refused = client.post("/slow", content=npz())
            assert refused.status_code == 503
            assert "2 requests wait already" in error_of(refused)
            assert refused.headers["retry-after"] == "1"
            assert client.get("/health").json()["waiting"] == 2
            slow.go.set()
            assert [answer.result().status_code for answer in first] == [200, 200]
        assert client.post("/slow", content=npz()).status_code == 200


def test_a_client_that_is_killed_costs_nobody_else_anything():
    slow = Slow()
    with serving(own_routes={"slow": slow}) as (client, service):
        head = b"POST /slow HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: "
        body = npz()
        address = (client.base_url.host, client.base_url.port)
        with ThreadPoolExecutor(2) as pool:
            kept = pool.submit(client.post, "/slow", files={"depth": ("kept.npz", body)})
            assert slow.begun.acquire(timeout=30)
            waiting = socket.create_connection(address)  # in the queue, then killed
            waiting.sendall(head + str(len(body)).encode() + b"\r\n\r\n" + body)
            half = socket.create_connection(address)  # killed midway
            half.sendall(head + str(len(body)).encode() + b"\r\n\r\n" + body[:100])
            until(lambda: service.waiting == 3)
            for killed in (waiting, half):
                killed.close()
            until(lambda: service.waiting == 1)
            slow.go.set()
            assert kept.result().json() == {"name": "kept"}
        after = client.post("/slow", files={"depth": ("after.npz", body)})
        assert after.json() == {"name": "after"}
        assert slow.names == ["kept", "after"]


def test_clients_that_hang_are_let_go():
    with serving(Limits(upload=0.3)) as (client, service):
        address = (client.base_url.host, client.base_url.port)
        with socket.create_connection(address) as head, socket.create_connection(address) as body:
            head.sendall(b"POST /reconstruct HTTP/1.1\r\n")  # and no more
            body.sendall(
                b"POST /reconstruct HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 99\r\n\r\nPK"
            )
            for hanging in (head, body):
                hanging.settimeout(20)
            assert head.recv(1000) == b""
            answer = body.recv(1000)
            assert answer.startswith(b"HTTP/1.1 408 ")
        until(lambda: service.waiting == 0)
        assert client.post("/reconstruct", content=npz()).status_code == 200


def test_an_answer_that_takes_too_long_is_504():
    slow = Slow()
    with serving(Limits(answer=0.2), own_routes={"slow": slow}) as (client, _):
        answer = client.post("/slow", content=npz())
        assert answer.status_code == 504
        slow.go.set()


def test_a_fault_is_500_and_the_next_request_is_answered(capsys):
    class Broken(Slow):
        def answer(self, image, form):
            raise ZeroDivisionError("no")

    class Missing(Slow):
        path = "/missing"

        def answer(self, image, form):
            raise MissingDependencyError("needs pybullet: pip install 'scenefw[simulation]'")

    own = {"broken": Broken(), "missing": Missing()}
    with serving(own_routes=own) as (client, _):
        answer = client.post("/slow", content=npz())
        assert answer.status_code == 500
        assert "ZeroDivisionError" in capsys.readouterr().err
        absent = client.post("/missing", content=npz())
        assert absent.status_code == 501
        assert "pip install" in error_of(absent)


def test_nothing_of_answered_requests_stays_but_what_is_remembered():
    class Forgetful(KnownBoxes):
        def complete(self, *arguments):
            sets = super().complete(*arguments)
            self.requests.clear()
            return sets

    pipeline = pipeline_of(Forgetful(GRID), samples=2)
    before = scenes_in_memory()
    with serving(Limits(body=1), pipeline) as (client, service):
        for number in range(10):
            image = npz(depth=FRAME.depth + np.float32(1e-5 * number))
            assert client.post("/reconstruct?format=glb", content=image).status_code == 200
            assert client.post("/reconstruct?sample=9", content=image).status_code == 422
            assert client.post("/reconstruct", content=bytes(2_000_000)).status_code == 413
        assert scenes_in_memory() - before == 2 * service.predictions.remembered


def scenes_in_memory():
    gc.collect()
    return sum(type(item) is SceneEstimate for item in gc.get_objects())  # proxies may be dead


def until(condition):
    end = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


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
