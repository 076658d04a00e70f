"""Where PyBullet computes: a process-wide library, a client for each simulation."""

from __future__ import annotations

from typing import Any

from scenefw.core.errors import MissingDependencyError
from scenefw.core.quiet import silenced


def connect() -> tuple[Any, int]:
    """The library, and a new client without a window.

    Raises:
        MissingDependencyError: pybullet is not installed.
    """
    try:
        with silenced():  # it says when it was built
            import pybullet
    except ImportError as error:
        raise MissingDependencyError(
            "simulating scenes needs pybullet: pip install 'scenefw[simulation]'"
        ) from error
    return pybullet, pybullet.connect(pybullet.DIRECT)
