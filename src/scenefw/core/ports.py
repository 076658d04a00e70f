"""Ports of this machine."""

from __future__ import annotations

import socket

from scenefw.core.errors import ConfigError


def require_free(host: str, port: int) -> int:
    """The port, or a free one for 0.

    Raises:
        ConfigError: it is in use or no port, or the host is not of this machine.
    """
    if not 0 <= port <= 65535:
        raise ConfigError(f"run.port = {port}: expected a number from 0 (any free one) to 65535")
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
            return int(probe.getsockname()[1])
    except socket.gaierror as error:
        raise ConfigError(f"run.host = {host}: no such host; give run.host=127.0.0.1") from error
    except PermissionError as error:
        raise ConfigError(
            f"port {port} is reserved for the system; give one above 1023, such as run.port=8080"
        ) from error
    except OSError as error:
        if error.errno == socket.errno.EADDRINUSE:  # type: ignore[attr-defined]
            raise in_use(host, port) from error
        raise ConfigError(
            f"run.host = {host}: {error.strerror}; give an address of this machine"
        ) from error


def in_use(host: str, port: int) -> ConfigError:
    """The error of a port that somebody else has."""
    return ConfigError(
        f"port {port} of {host} is in use; give another, such as run.port={min(port + 1, 65535)}"
    )
