"""The server of the viewer: a port that is free, and viser on it."""

from __future__ import annotations

import contextlib
import functools
import io
import sys
from typing import TYPE_CHECKING, Any

from scenefw.core.errors import MissingDependencyError
from scenefw.core.ports import in_use, require_free

if TYPE_CHECKING:
    from collections.abc import Iterator

_LOCAL = ("127.0.0.1", "::1", "localhost")


def open_server(host: str, port: int) -> Any:
    """A viser server that answers there and nowhere else.

    On this machine alone it also refuses pages of other servers, which a browser would let talk
    to it (cross-site hijacking of WebSockets, RFC 6455, 10.2).

    Raises:
        ConfigError: as `require_free`.
        MissingDependencyError: viser is not installed.
    """
    viser = require_viser()
    port = require_free(host, port)
    origins = _origins(port) if host in _LOCAL else None
    with _only_from(origins), contextlib.redirect_stdout(io.StringIO()):  # it prints a panel
        server = viser.ViserServer(host=host, port=port, label="scenefw", verbose=False)
    if server.get_port() != port:  # taken meanwhile: viser moves on to the next one
        close_server(server)
        raise in_use(host, port)
    server.gui.configure_theme(show_logo=False, show_share_button=False)
    return server


def _origins(port: int) -> list[str | None]:
    """Pages that may talk to a server of this machine; programs that are no browser say none."""
    return [None, *(f"http://{name}:{port}" for name in ("127.0.0.1", "localhost", "[::1]"))]


@contextlib.contextmanager
def _only_from(origins: list[str | None] | None) -> Iterator[None]:
    """While a viser server starts: it has no setting for that, what it is built on has one."""
    from websockets.asyncio import server

    before = server.serve
    allowed_origins: Any = origins
    server.serve = functools.partial(before, origins=allowed_origins)  # type: ignore[assignment,misc]
    try:
        yield
    finally:
        server.serve = before  # type: ignore[misc]


def close_server(server: Any) -> None:
    """Ends a viser server and frees its port."""
    with contextlib.redirect_stdout(io.StringIO()):  # it says so
        server.stop()


def require_viser() -> Any:
    """The library.

    Raises:
        MissingDependencyError: it is not installed.
    """
    try:
        import viser
    except ImportError as error:
        raise MissingDependencyError(
            "run=view needs viser: pip install 'scenefw[viewer]'"
        ) from error
    return viser


def announce(host: str, port: int) -> None:
    """Prints the address of a page, and a warning if others reach it too."""
    if host not in _LOCAL:
        print(
            f"anybody who reaches {host} can look, change and export; "
            "run.host=127.0.0.1 is for this machine alone",
            file=sys.stderr,
        )
    name = f"[{host}]" if ":" in host else host
    address = "127.0.0.1" if host == "0.0.0.0" else name
    print(f"http://{address}:{port} shows it; Ctrl-C ends it", flush=True)
