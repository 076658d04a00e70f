"""Where files go that can be made again: compiled kernels, convex parts of meshes."""

from __future__ import annotations

import logging
import os
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path


def cache_folder() -> Path | None:
    """The user's cache, else a private folder among temporary files; None: neither is writable.

    What lies in a cache may be code, so a folder that another user can write is never taken.
    """
    return next(filter(is_writable, _candidates()), None)


def is_writable(folder: Path) -> bool:
    """Whether files can be made in a folder, which is made if it isn't there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK)


def share_with_matplotlib() -> None:
    """Lets matplotlib write where we do if it can't write into the user's folders.

    Else each process makes a folder for it, which need not be told in two lines.
    """
    private, cache = _private_folder(), cache_folder()
    if cache is None:
        logging.getLogger("matplotlib").setLevel(logging.ERROR)
    elif cache == private:
        os.environ.setdefault("MPLCONFIGDIR", str(cache / "matplotlib"))


def _candidates() -> Iterator[Path]:
    cache = os.environ.get("XDG_CACHE_HOME")
    if cache is not None and Path(cache).is_absolute():
        yield Path(cache)
    try:
        home = Path.home()
    except RuntimeError:  # no HOME, and the user has no entry among users, as in containers
        home = Path()
    if home.is_absolute():
        yield home / ".cache"
    private = _private_folder()
    if private is not None:
        yield private


def _private_folder() -> Path | None:
    """A folder among temporary files that is this user's alone; None if there can't be one."""
    try:
        temporary = Path(tempfile.gettempdir())
    except FileNotFoundError:
        return None
    if temporary == Path.cwd():  # the last resort of `tempfile`; nobody wants a cache there
        return None
    user = os.getuid() if hasattr(os, "getuid") else None
    folder = temporary / ("scenefw" if user is None else f"scenefw-{user}")
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        status = folder.lstat()
    except OSError:
        return None
    ours = user is None or (status.st_uid == user and not status.st_mode & 0o077)
    return folder if stat.S_ISDIR(status.st_mode) and ours else None
