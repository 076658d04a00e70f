"""Files: the order of their names, and atomic writing, so that no file is ever half-written."""

import os
import re
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from scenefw.core.errors import StorageError

_NUMBER = re.compile(r"(?<![0-9])(?<![0-9]\.)[0-9]+")
"""A whole number, or what comes before a decimal point; digits after one sort well as text."""

_LONGEST_NAME = 255


def in_order(paths: Iterable[Path]) -> list[Path]:
    """Files and folders by name, numbers by their value: 2 before 10.

    Names whose numbers are padded to one width come in the order of their text.
    """
    return sorted(paths, key=lambda path: ([_padded(part) for part in path.parts], path))


def _padded(name: str) -> str:
    return _NUMBER.sub(lambda number: number[0].zfill(_LONGEST_NAME), name)


@contextmanager
def replacing(target: Path | str) -> Iterator[Path]:
    """Yields a temporary path beside `target` which replaces it when the block ends without error.

    The temporary name keeps the suffix of the target, as writers choose the format by it.

    Raises:
        StorageError: the folder can't be created or written, or the disk is full.
    """
    target = Path(target)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(
            prefix=f".{target.stem}.", suffix=target.suffix, dir=target.parent
        )
        os.close(handle)
    except OSError as error:
        raise _unwritable(target, error) from error
    temporary = Path(name)
    try:
        yield temporary
        _give_default_mode(temporary)
        temporary.replace(target)
    except OSError as error:
        raise _unwritable(target, error) from error
    finally:
        temporary.unlink(missing_ok=True)


def write_text(target: Path | str, text: str) -> None:
    """Writes UTF-8 text atomically."""
    with replacing(target) as temporary:
        temporary.write_text(text, encoding="utf-8")


def require_writable(folder: Path | str) -> Path:
    """Returns the folder, created if need be, or raises a StorageError before any work is lost."""
    folder = Path(folder)
    with replacing(folder / ".writable"):
        pass
    (folder / ".writable").unlink(missing_ok=True)
    return folder


def unreadable(error: Exception) -> str:
    """Why a file of arrays can't be read, in a few words; numpy takes other files for pickles."""
    words = str(error).splitlines()[0] if str(error) else type(error).__name__
    return "it is no file of NumPy arrays" if "pickle" in words else words


def _give_default_mode(path: Path) -> None:
    mask = os.umask(0)
    os.umask(mask)
    path.chmod(0o666 & ~mask)


def _unwritable(target: Path, error: OSError) -> StorageError:
    reason = error.strerror or str(error)
    return StorageError(
        f"cannot write {target}: {reason}; "
        "choose a writable folder with free space (paths.output=...)"
    )
