"""The service as an ASGI application: what comes in, what goes out, and what is refused."""

from __future__ import annotations

import asyncio
import json
import sys
import traceback
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from fastapi import Depends, FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse, JSONResponse, Response
from starlette.datastructures import UploadFile
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from scenefw.config import near_misses
from scenefw.core.errors import (
    ConfigError,
    InputError,
    MissingDependencyError,
    SceneFWError,
)
from scenefw.core.versions import versions
from scenefw_serving.image_request import ImageRequest, Predictions
from scenefw_serving.page import index_page
from scenefw_serving.uploads import FIELDS, LimitError, Part, Upload, in_fields

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine

    from scenefw_serving.limits import Limits
    from scenefw_serving.protocols import Route
    from scenefw_serving.work import Work

_MULTIPART = "multipart/form-data"
_STATUS = (
    (LimitError, 413),
    (InputError, 422),
    (ConfigError, 422),
    (MissingDependencyError, 501),
    (SceneFWError, 500),
)
_CLIENT_GONE = 499  # as nginx calls it; nobody reads it


class Service:
    """Answers requests; what they cost is done by `work`, one after another.

    Args:
        routes: by name.
        predictions: of images.
        limits: of requests.
        work: where images are read and predicted.
        hosts: names that clients may call this machine; None: any.
    """

    def __init__(
        self,
        routes: Mapping[str, Route],
        predictions: Predictions,
        limits: Limits,
        work: Work,
        hosts: Sequence[str] | None = None,
    ) -> None:
        self.routes, self.predictions = routes, predictions
        self.limits, self.work, self.hosts = limits, work, hosts
        self.waiting = self.answered = 0

    def application(self) -> FastAPI:
        """The application, with its OpenAPI description at `/openapi.json`."""
        app = FastAPI(
            title="scenefw",
            version=versions()["scenefw"],
            docs_url=None,
            redoc_url=None,
            dependencies=[Depends(self._require_own), Depends(_require_declared)],
        )
        app.add_exception_handler(SceneFWError, _refused)
        app.add_exception_handler(RequestValidationError, _misspelt)
        app.add_exception_handler(HTTPException, _told)
        app.add_exception_handler(ClientDisconnect, _hung_up)
        for route in self.routes.values():
            app.add_api_route(
                route.path,
                self._endpoint(route),
                methods=["POST"],
                summary=route.summary,
                response_class=Response,
                openapi_extra=_description(route),
            )
        app.add_api_route("/health", self.health, summary="Whether it is ready, how many wait")
        app.add_api_route(
            "/", lambda: HTMLResponse(index_page(app.openapi())), include_in_schema=False
        )
        return app

    async def health(self) -> dict[str, Any]:
        """`status`, `waiting` requests of at most `queue`, and how many were answered."""
        return {
            "status": "ready",
            "waiting": self.waiting,
            "queue": self.limits.queue,
            "answered": self.answered,
            "versions": versions(),
        }

    async def _require_own(self, request: Request) -> None:
        """Refuses pages of other servers, which a browser would let talk to this machine."""
        if self.hosts is None:
            return
        host, origin = request.url.hostname or "", request.headers.get("origin")
        is_own = origin is None or origin == f"{request.url.scheme}://{request.url.netloc}"
        if host not in self.hosts or not is_own:
            raise HTTPException(403, f"requests by {origin or host} are refused; ask 127.0.0.1")

    def _endpoint(self, route: Route) -> Callable[..., Coroutine[Any, Any, Response]]:
        async def endpoint(
            request: Request,
            format: str = next(iter(route.formats)),  # noqa: A002 - as the client calls it
            sample: int = 0,
            depth_scale: float | None = None,
        ) -> Response:
            if format not in route.formats:
                raise InputError(f"format = {format}: expected {' or '.join(route.formats)}")
            if self.waiting >= self.limits.queue:
                return _error(
                    503, f"{self.waiting} requests wait already; try again later", retry=True
                )
            self.waiting += 1
            try:
                upload = Upload(await self._parts(request), depth_scale)

                def job() -> bytes:
                    return self._content(route, upload, format, sample)

                return await self._answer(request, job, route.formats[format])
            finally:
                self.waiting -= 1

        return endpoint

    def _content(self, route: Route, upload: Upload, form: str, sample: int) -> bytes:
        frame, mask, camera_pose = upload.read(self.limits)
        image = ImageRequest(frame, self.predictions, mask, sample, camera_pose)
        answer = route.answer(image, form)
        if isinstance(answer, bytes):
            return answer
        return json.dumps(answer, allow_nan=False).encode()

    async def _answer(
        self, request: Request, job: Callable[[], bytes], media_type: str
    ) -> Response:
        future = asyncio.wrap_future(self.work.submit(job))
        gone = asyncio.ensure_future(_gone(request))
        try:
            done, _ = await asyncio.wait(
                {future, gone}, timeout=self.limits.answer, return_when=asyncio.FIRST_COMPLETED
            )
            if future in done:
                error = future.exception()
                if error is not None:
                    return _refusal(error)
                self.answered += 1
                return Response(future.result(), media_type=media_type)
            if gone in done:
                return Response(status_code=_CLIENT_GONE)
            return _error(504, f"no answer within {self.limits.answer:g} s (run.limits.answer)")
        finally:
            gone.cancel()
            future.cancel()

    async def _parts(self, request: Request) -> dict[str, list[Part]]:
        """The parts of a request by field; a body that is no form is the depth image."""
        body = await self._body(request)
        if not request.headers.get("content-type", "").startswith(_MULTIPART):
            return {"depth": [Part(body)]} if body else {}
        return await _form(request, body, self.limits.masks + len(FIELDS))

    async def _body(self, request: Request) -> bytes:
        limit = self.limits.body_bytes
        length = request.headers.get("content-length", "")
        if length.isdigit() and int(length) > limit:
            raise _too_large(self.limits)
        body = bytearray()
        try:
            async with asyncio.timeout(self.limits.upload):
                async for chunk in request.stream():
                    body += chunk
                    if len(body) > limit:
                        raise _too_large(self.limits)
        except TimeoutError as error:
            seconds = f"{self.limits.upload:g} s (run.limits.upload)"
            raise HTTPException(408, f"the request hasn't come whole within {seconds}") from error
        return bytes(body)


async def _require_declared(request: Request) -> None:
    declared = [field.alias for field in request.scope["route"].dependant.query_params]
    for name in request.query_params:
        if name not in declared:
            raise InputError(f"no parameter {name}; {near_misses(name, declared)}")


async def _form(request: Request, body: bytes, most: int) -> dict[str, list[Part]]:
    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": body, "more_body": False}

    whole = Request(request.scope, receive)
    parts: dict[str, list[Part]] = {}
    async with whole.form(max_files=most, max_fields=most, max_part_size=len(body)) as form:
        for name, value in form.multi_items():
            if isinstance(value, UploadFile):
                part = Part(await value.read(), value.filename or "")
            else:
                part = Part(value.encode())
            parts.setdefault("colour" if name == "color" else name, []).append(part)
    return parts


async def _gone(request: Request) -> None:
    """Returns when the client has hung up."""
    while (await request.receive())["type"] != "http.disconnect":
        pass


def _too_large(limits: Limits) -> LimitError:
    return LimitError(f"the request is larger than {limits.body:g} MB (run.limits.body)")


def _error(status: int, line: str, *, retry: bool = False) -> JSONResponse:
    headers = {"Retry-After": "1"} if retry else None
    return JSONResponse({"error": " ".join(line.split())}, status, headers)


async def _refused(_: Request, error: Exception) -> Response:
    return _refusal(error)


def _refusal(error: BaseException) -> Response:
    """An error as an answer; of a fault of scenefw the terminal gets the traceback."""
    for kind, status in _STATUS:
        if isinstance(error, kind):
            return _error(status, in_fields(str(error)))
    traceback.print_exception(error, file=sys.stderr)
    return _error(500, "the service failed; its terminal says how")


async def _misspelt(_: Request, error: Exception) -> Response:
    """A parameter that is no number, in one line."""
    assert isinstance(error, RequestValidationError)
    first = error.errors()[0]
    return _error(422, f"{first['loc'][-1]} = {first.get('input')}: {first['msg']}")


async def _told(_: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    return _error(error.status_code, str(error.detail))


async def _hung_up(_: Request, __: Exception) -> Response:
    return Response(status_code=_CLIENT_GONE)


def _description(route: Route) -> dict[str, Any]:
    """What OpenAPI says of the body, and of the formats of answers."""
    binary = {"type": "string", "format": "binary"}
    fields: dict[str, Any] = {
        name: {**binary, "description": words} for name, words in FIELDS.items()
    }
    fields["masks"] = {"type": "array", "items": binary, "description": FIELDS["masks"]}
    form = {"type": "object", "properties": fields, "required": ["depth"]}
    return {
        "requestBody": {
            "required": True,
            "content": {
                _MULTIPART: {"schema": form},
                "application/octet-stream": {"schema": binary},
            },
        },
        "responses": {
            "200": {
                "description": " or ".join(route.formats),
                "content": {kind: {} for kind in dict.fromkeys(route.formats.values())},
            },
            "413": {"description": "larger than the service takes"},
            "422": {"description": "unusable; `error` says why, and what helps"},
            "503": {"description": "too many requests wait"},
        },
    }
