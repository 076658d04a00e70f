"""Many clients, clients that hang or go, faults, and memory."""

import gc
import socket
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from plugins.serving.tests.services import FRAME, GRID, Slow, error_of, httpx, npz, serving, until
from tests.unit.perception.pipelines import KnownBoxes, pipeline_of

from scenefw.core.errors import MissingDependencyError
from scenefw.core.types import SceneEstimate
from scenefw_serving.limits import Limits


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


@pytest.mark.exhaustive
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
