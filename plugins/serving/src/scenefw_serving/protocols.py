"""What a route of the service promises."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from scenefw_serving.image_request import ImageRequest


class Route(Protocol):
    """Answers requests about a depth image at one path (group `route`).

    Attributes:
        path: such as `/reconstruct`.
        summary: what it answers, one line.
        formats: media type of each format of its answers by name; the first is the default.
    """

    path: str
    summary: str
    formats: Mapping[str, str]

    def answer(self, image: ImageRequest, form: str) -> bytes | Mapping[str, Any]:
        """The content of an answer; a mapping becomes JSON.

        It is called in one thread, one request after another.

        Args:
            image: with its scenes, which are predicted when they are asked for.
            form: a name of `formats`.

        Raises:
            SceneFWError: the message is the client's answer, with a status by its kind.
        """
