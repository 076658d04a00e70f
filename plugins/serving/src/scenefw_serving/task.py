"""Answers requests over HTTP with a warm predictor."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.errors import ConfigError, MissingDependencyError
from scenefw.core.ports import require_free
from scenefw.core.settings import NOT_NEGATIVE
from scenefw.core.types import Camera, Frame
from scenefw_serving.image_request import Predictions
from scenefw_serving.limits import Limits
from scenefw_serving.protocols import Route
from scenefw_serving.work import Work

if TYPE_CHECKING:
    from scenefw.perception.pipeline import ReconstructionPipeline

_LOCAL = ("127.0.0.1", "localhost", "::1")


class Serve:
    """Serves until Ctrl-C (`run=serve`). Images are read and predicted one after another.

    Args:
        pipeline: makes the scenes of an image; `pipeline.samples` says how many.
        routes: what is answered, by name.
        host: address that clients reach it at; 127.0.0.1 is for this machine alone.
        port: 0 takes a free one.
        seconds: ends after this time; None = with Ctrl-C.
        warm_up: reconstructs a small image before the first request.
        remembered: images whose scenes are kept.
        limits: of requests.

    Raises:
        ConfigError: a number that isn't positive, or two routes at one path.
    """

    def __init__(
        self,
        pipeline: ReconstructionPipeline,
        routes: Mapping[str, Route],
        host: str = "127.0.0.1",
        port: int = 8090,
        seconds: float | None = None,
        remembered: int = 4,
        limits: Limits | None = None,
        *,
        warm_up: bool = True,
    ) -> None:
        if seconds is not None and not seconds > 0:
            raise ConfigError(f"run.seconds = {seconds}: expected seconds above 0, or null")
        NOT_NEGATIVE.require(remembered=remembered)
        paths = [route.path for route in routes.values()]
        if len(set(paths)) < len(paths):
            raise ConfigError(f"two routes answer at one path: {', '.join(sorted(paths))}")
        self.routes = dict(routes)
        self.host, self.port, self.seconds = host, port, seconds
        self.warm_up, self.limits = warm_up, limits or Limits()
        self.predictions = Predictions(pipeline, remembered)

    def run(self) -> dict[str, float]:
        """Serves until it ends; returns how many requests were answered.

        Raises:
            ConfigError: the port is in use.
            MissingDependencyError: fastapi or uvicorn is not installed.
        """
        _require_libraries()
        from scenefw_serving.application import Service
        from scenefw_serving.server import bound, listening

        require_free(self.host, self.port)  # says in words why it is not
        listener = bound(self.host, self.port)
        work = Work()
        hosts = _LOCAL if self.host in _LOCAL else None
        service = Service(self.routes, self.predictions, self.limits, work, hosts)
        try:
            if self.warm_up:
                self.predictions.pipeline(warm_up_image())
            with listening(service.application(), listener, self.limits):
                _announce(self.host, listener.getsockname()[1], self.routes)
                work.run(self.seconds)
        except KeyboardInterrupt:
            pass
        finally:
            listener.close()
        print(f"service ended; requests answered: {service.answered}")
        return {"answered": float(service.answered)}


def warm_up_image() -> Frame:
    """Two blocks on a table, from 80 cm above: what loads weights and compiles kernels."""
    depth = np.full((240, 320), 0.8, dtype=np.float32)
    depth[90:150, 70:130] = 0.7
    depth[100:150, 180:250] = 0.74
    return Frame(depth, Camera(320, 240, 300.0, 300.0, 159.5, 119.5), name="warm-up")


def _require_libraries() -> None:
    try:
        import fastapi  # noqa: F401
        import python_multipart  # noqa: F401
        import uvicorn  # noqa: F401
    except ImportError as error:
        raise MissingDependencyError(
            f"run=serve needs {error.name}: pip install 'scenefw[serve]'"
        ) from error


def _announce(host: str, port: int, routes: Mapping[str, Route]) -> None:
    if host not in _LOCAL:
        print(
            f"anybody who reaches {host} can send images; "
            "run.host=127.0.0.1 is for this machine alone",
            file=sys.stderr,
        )
    name = f"[{host}]" if ":" in host else host
    address = f"http://{'127.0.0.1' if host == '0.0.0.0' else name}:{port}"
    paths = ", ".join(route.path for route in routes.values())
    print(f"{address} answers POST {paths}; Ctrl-C ends it", flush=True)
