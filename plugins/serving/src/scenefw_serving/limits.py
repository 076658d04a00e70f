"""How much a service takes at once, and for how long."""

from __future__ import annotations

from dataclasses import dataclass

from scenefw.core.settings import COUNT, POSITIVE


@dataclass(frozen=True)
class Limits:
    """Bounds of requests; what is beyond is refused before it costs anything.

    Args:
        body: megabytes of a request.
        pixels: megapixels of an image.
        masks: in one request.
        upload: seconds until a request has come whole.
        answer: seconds until it is answered, with the time in the queue.
        queue: requests at once, that being worked on included.
        connections: open at once.

    Raises:
        SettingError: a number that isn't positive.
    """

    body: float = 32
    pixels: float = 4
    masks: int = 256
    upload: float = 30.0
    answer: float = 120.0
    queue: int = 24
    connections: int = 128

    def __post_init__(self) -> None:
        POSITIVE.require(body=self.body, pixels=self.pixels, upload=self.upload, answer=self.answer)
        COUNT.require(masks=self.masks, queue=self.queue, connections=self.connections)

    @property
    def body_bytes(self) -> int:
        """Of a request at most."""
        return int(self.body * 1e6)

    @property
    def pixel_count(self) -> int:
        """Of an image at most."""
        return int(self.pixels * 1e6)
