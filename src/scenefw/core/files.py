"""Files: the order of their names, and atomic writing, so that no file is ever half-written."""

import io
import lzma
import os
import re
import secrets
import stat
import struct
import zipfile
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from scenefw.core.errors import ConfigError, StorageError

_NUMBER = re.compile(r"(?<![0-9])(?<![0-9]\.)[0-9]+")
"""A whole number, or what comes before a decimal point; digits after one sort well as text."""

_LONGEST_NAME = 255
_SUFFIXES = 40
"""Left for suffixes and what a temporary name adds (bytes)."""

DAMAGED = (
    OSError, ValueError, EOFError, LookupError, SyntaxError, OverflowError, MemoryError,
    RuntimeError, struct.error, zipfile.BadZipFile, zlib.error, lzma.LZMAError,
)  # fmt: skip
"""What numpy, zipfile and PIL raise for files that are damaged, or written as they don't read.

A header may ask for more memory than there is, an archive for a password, and PIL calls a broken
PNG a SyntaxError.
"""


_protected_files: set[Path] = set()  # files of somebody else


@contextmanager
def keeping(files: Iterable[Path]) -> Iterator[None]:
    """Within the block, `replacing` refuses to replace these files."""
    added = {Path(os.path.realpath(file)) for file in files} - _protected_files
    _protected_files.update(added)
    try:
        yield
    finally:
        _protected_files.difference_update(added)


def require_free(target: Path | str) -> None:
    """Finds out before the work whether a file may be written.

    Raises:
        StorageError: it would replace one that is kept.
    """
    if Path(os.path.realpath(target)) in _protected_files:
        raise StorageError(
            f"{target} is not of a run of scenefw, and would be lost; give another paths.output, "
            "or move it away"
        )


def in_order(paths: Iterable[Path]) -> list[Path]:
    """Files and folders sorted by name, numbers by value: 2 before 10.

    Names whose numbers are padded to one width come in the order of their text.
    """
    return sorted(paths, key=lambda path: ([_padded(part) for part in path.parts], path))


def _padded(name: str) -> str:
    return _NUMBER.sub(lambda number: number[0].zfill(_LONGEST_NAME), name)


@contextmanager
def replacing(target: Path | str) -> Iterator[Path]:
    """Yields a temporary path which replaces `target` when the block ends without error.

    The temporary name keeps the suffix of the target, as writers choose the format by it. A file
    that is there gives its mode to the new one, and a link stays: the file that it names is
    replaced.

    Raises:
        StorageError: the folder can't be created or written, the disk is full, or the target is no
            plain file, or one that is kept.
    """
    target = Path(target)
    require_free(target)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        file = Path(os.path.realpath(target))
        mode = _mode(file, target)
        temporary = _beside(file, target.suffix, 0o666 if mode is None else 0o600)
    except OSError as error:
        raise unwritable(target, error) from error
    try:
        yield temporary
        if mode is not None:
            temporary.chmod(mode)
        temporary.replace(file)
    except OSError as error:
        raise unwritable(target, error) from error
    finally:
        temporary.unlink(missing_ok=True)


def utf8_text(path: Path) -> str:
    """The text of a file.

    Raises:
        OSError: it can't be read.
        ValueError: it is not UTF-8; the message says where.
    """
    data = path.read_bytes()
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ValueError(f"line {line} is not UTF-8; save it as UTF-8") from error


def write_text(target: Path | str, text: str) -> None:
    """Writes UTF-8 text atomically."""
    with replacing(target) as temporary:
        temporary.write_text(text, encoding="utf-8")


def append_text(target: Path | str, text: str) -> None:
    """Adds UTF-8 text to a file, all of it or nothing.

    Raises:
        StorageError: the file can't be written, or the disk is full.
    """
    target = Path(target)
    try:
        with target.open("ab", buffering=0) as file:
            before = file.tell()
            try:
                _write_all(file, text.encode("utf-8"))
            except OSError:
                file.truncate(before)
                raise
    except OSError as error:
        raise unwritable(target, error) from error


def _write_all(file: io.RawIOBase, content: bytes) -> None:
    remainder = memoryview(content)
    while remainder:  # a nearly full disk writes a part, and fails at the next
        remainder = remainder[file.write(remainder) or 0 :]


def require_writable(folder: Path | str) -> Path:
    """Returns the folder, created if needed, or raises a StorageError before any work is lost."""
    folder = Path(folder)
    with replacing(folder / ".writable"):
        pass
    (folder / ".writable").unlink(missing_ok=True)
    return folder


def require_name(name: str, setting: str) -> str:
    """Returns a plain file name.

    Args:
        name: without suffix.
        setting: that holds it.

    Raises:
        ConfigError: it is empty, or a path, which would leave the output folder.
    """
    plain = bool(name) and name not in (".", "..") and not set(name) & set("/\\\0")
    if not plain or len(name.encode()) > _LONGEST_NAME - _SUFFIXES:
        raise ConfigError(
            f"{setting} is '{name}'; expected a plain file name, such as {setting}=mine (the "
            "folder is paths.output)"
        )
    return name


def require_apart(output: Path | str, source: Path | str) -> None:
    """Finds out before the work whether results would get among the images they are made of.

    Raises:
        ConfigError: the output is the folder of the input, or one of its folders of images.
    """
    folder, target = Path(source).resolve(), Path(output).resolve()
    images = [folder / name for name in ("", "depth", "rgb", "labels", "poses")]
    if folder.is_dir() and target in images:
        raise ConfigError(
            f"paths.output={output} is the folder of the input, whose images results would mix "
            f"with; give another, such as paths.output={folder / 'results'}"
        )


def unwritable(target: Path | str, error: OSError) -> StorageError:
    """What to tell about a file or folder that can't be written."""
    reason = error.strerror or str(error)
    return StorageError(
        f"cannot write {target}: {reason}; "
        "choose a writable folder with free space (paths.output=...)"
    )


def unreadable(error: Exception, advice: str = "") -> str:
    """Why a file of arrays or a picture can't be read, in a few words, and what to do about it.

    Args:
        error: one of `DAMAGED`; numpy takes files of other kinds for pickles.
        advice: what to do if the file is damaged.
    """
    if isinstance(error, OSError) and error.strerror:
        return error.strerror.lower()  # without its number, and the path, which the message has
    words = str(error).splitlines()[0] if str(error) else type(error).__name__
    if words.startswith("Object arrays"):
        return "it holds pickled objects, which are never loaded; store plain arrays of numbers"
    if "pickle" in words:
        words = "it is not a file of NumPy arrays"
    return f"{words}; {advice}" if advice else words


def _mode(file: Path, target: Path) -> int | None:
    """Permissions of a file that is to be replaced, or None if there is none."""
    try:
        mode = file.lstat().st_mode
    except FileNotFoundError:
        return None
    if not stat.S_ISREG(mode):  # or links in a circle
        kind = "a folder" if stat.S_ISDIR(mode) else "no plain file"
        raise StorageError(f"cannot write {target}: it is {kind}; give another path")
    return stat.S_IMODE(mode)


def _beside(file: Path, suffix: str, mode: int) -> Path:
    """A new file in the same folder; its mode is narrowed as the system does for any new file."""
    while True:
        name = file.with_name(f".{file.stem}.{secrets.token_hex(4)}{suffix}")
        try:
            os.close(os.open(name, os.O_CREAT | os.O_EXCL | os.O_WRONLY, mode))
        except FileExistsError:
            continue
        return name
