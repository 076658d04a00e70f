"""Open3D, imported where it is used."""

from __future__ import annotations

import warnings
from typing import Any

from scenefw.core.errors import MissingDependencyError


def require_open3d(purpose: str) -> Any:
    """The library.

    Args:
        purpose: what needs it, as a message begins.

    Raises:
        MissingDependencyError: it is not installed, or a system library is missing.
    """
    # It brings a TBB that is too old for numba, which takes another layer of threads and says so
    warnings.filterwarnings("ignore", message=r".*The TBB threading layer requires")
    try:
        import open3d
    except (ImportError, OSError) as error:  # OSError: a system library is missing
        raise MissingDependencyError(
            f"{purpose} needs Open3D ({error}): pip install 'scenefw[open3d]', and the system "
            "libraries libusb-1.0-0 libgl1 libgomp1"
        ) from error
    return open3d
