"""The socket of the service, and uvicorn on it."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import threading
from typing import TYPE_CHECKING, Any

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from scenefw.core.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from scenefw_serving.limits import Limits

_GRACE = 2  # s that answers on their way have when the service ends
_START = 10.0  # s until a server that can start has started


@contextlib.contextmanager
def listening(app: Any, listener: socket.socket, limits: Limits) -> Iterator[None]:
    """Within the block a thread answers requests.

    Args:
        app: an ASGI application.
        listener: a bound socket, which is closed in the end.
        limits: of connections and uploads.

    Raises:
        ConfigError: the server doesn't start.
    """
    config = uvicorn.Config(
        app,
        http=_protocol(limits.upload),
        ws="none",
        log_level="error",
        limit_concurrency=limits.connections,
        timeout_graceful_shutdown=_GRACE,
        server_header=False,
    )
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
    thread.start()
    try:
        _await_start(server, thread)
        yield
    finally:
        server.should_exit = True
        thread.join(_GRACE + _START)
        listener.close()


def bound(host: str, port: int) -> socket.socket:
    """A socket that is bound, so that nobody else takes the port before the service starts.

    Raises:
        ConfigError: the port is in use.
    """
    family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    listener = socket.socket(family, socket.SOCK_STREAM)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(socket.SOMAXCONN)
    except OSError as error:
        listener.close()
        raise ConfigError(f"port {port} of {host}: {error.strerror}; give another run.port") from (
            error
        )
    return listener


def _await_start(server: uvicorn.Server, thread: threading.Thread) -> None:
    pause = threading.Event()
    for _ in range(int(_START / 0.01)):
        if server.started:
            return
        if not thread.is_alive():
            break
        pause.wait(0.01)
    raise ConfigError("the service doesn't start; -v shows why")


def _protocol(seconds: float) -> type[asyncio.Protocol]:
    """HTTP, in which whoever sends no whole head of a request for so long is let go.

    uvicorn waits without an end for the head of the first request of a connection.
    """
    import h11

    class Impatient(H11Protocol):
        _timer: asyncio.TimerHandle | None = None

        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            super().connection_made(transport)
            self._watch()

        def data_received(self, data: bytes) -> None:
            super().data_received(data)
            self._watch()

        def connection_lost(self, exc: Exception | None) -> None:
            self._stop()
            super().connection_lost(exc)

        def _watch(self) -> None:
            if self.conn.their_state is not h11.IDLE:
                self._stop()
            elif self._timer is None:
                self._timer = self.loop.call_later(seconds, self.transport.close)

        def _stop(self) -> None:
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None

    return Impatient
