"""Folders of results: each appears whole, and a new one costs no file that scenefw didn't write."""

import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from scenefw.core.errors import StorageError
from scenefw.core.files import unwritable, write_text

MANIFEST = ".scenefw.json"
"""Hidden file of a folder of results: what scenefw wrote there, by name, with SHA-256."""

_NOTE = "what scenefw wrote here and may replace; it keeps all other files"
_REMEDY = "give another folder, or move it away"


@contextmanager
def replacing_folder(target: Path | str, *, listed: bool = True) -> Iterator[Path]:
    """Yields a temporary folder beside `target` which takes its place when the block ends well.

    Of an earlier version goes what scenefw wrote, which its manifest lists. All other files come
    into the new folder, and a link to a folder stays. Digests decide, not sizes or times: a file
    that somebody has edited may well keep its size, and copies have other times.

    Args:
        target: the folder.
        listed: write a manifest; without one, the folder is never replaced.

    Raises:
        StorageError: the folder can't be written, holds files of somebody else only, or files that
            were changed since; before the block. Or the new folder has a file of the same name as
            one of somebody else; then all is left as it was.
    """
    real = Path(os.path.realpath(target))
    require_replaceable(target)
    with _beside(real) as temporary:
        new = temporary / "new" / real.name  # writers may read its name
        new.mkdir(parents=True)
        yield new
        if listed:
            _write_manifest(new, _digests(new))
        if real.exists():
            _keep_foreign_files(real, new)
        _swap(real, new, temporary / "old")


@contextmanager
def adding_to_folder(target: Path | str) -> Iterator[Path]:
    """Yields a temporary folder whose files go into a folder of results when the block ends well.

    Raises:
        StorageError: the folder can't be written, or holds a file of somebody else by such a name.
    """
    real = Path(os.path.realpath(target))
    with _beside(real) as temporary:
        yield temporary
        added, manifest = _digests(temporary), _listed(real) or {}
        foreign_files = set(_foreign_files(real, manifest))
        for name in added:
            if name in foreign_files:
                raise _in_the_way(Path(target) / name)
        for name in added:
            (real / name).parent.mkdir(parents=True, exist_ok=True)
            (temporary / name).replace(real / name)
        _write_manifest(real, {**manifest, **added})


def require_replaceable(target: Path | str) -> None:
    """Finds out before the work whether a result may take the place of what is there.

    Raises:
        StorageError: it holds files, none of which scenefw wrote, or some that were changed since.
    """
    folder = Path(target)
    if not folder.exists():
        return
    try:
        manifest = _listed(folder)
        names = sorted(entry.name for entry in folder.iterdir() if entry.name != MANIFEST)
        if names and manifest is None:
            raise StorageError(
                f"{folder} is no folder of results: it holds other files, such as {names[0]}; "
                "give another folder, or move them away"
            )
        changed = sorted(set(_foreign_files(folder, manifest or {})) & set(manifest or {}))
    except OSError as error:
        raise unwritable(target, error) from error
    if changed:
        raise StorageError(
            f"{folder / changed[0]} was changed since scenefw wrote it, and would be lost; "
            f"{_REMEDY}"
        )


@contextmanager
def _beside(target: Path) -> Iterator[Path]:
    """A temporary folder in the same place, gone afterwards unless it holds the only copy."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    except OSError as error:
        raise unwritable(target, error) from error
    try:
        yield temporary
    except OSError as error:
        raise unwritable(target, error) from error
    finally:
        if target.exists() or not (temporary / "old").exists():
            shutil.rmtree(temporary, ignore_errors=True)


def _swap(target: Path, new: Path, old: Path) -> None:
    """Puts the new folder into the place of the one that is there, or leaves that one."""
    try:
        if target.exists():
            target.rename(old)
        new.rename(target)
    finally:  # also when Ctrl-C comes in between
        if old.exists() and not target.exists():
            _put_back(old, target)


def _put_back(old: Path, target: Path) -> None:
    try:
        old.rename(target)
    except OSError as error:
        raise StorageError(
            f"cannot write {target}: {error.strerror}; what was there is now {old}, move it back"
        ) from error


def _keep_foreign_files(target: Path, new: Path) -> None:
    """Links the files of somebody else into the new folder, so that nothing has to be undone."""
    foreign_files = _foreign_files(target, _listed(target) or {})
    for name in foreign_files:
        above = (new / parent for parent in Path(name).parents)
        if os.path.lexists(new / name) or any(
            folder.exists() and not folder.is_dir() for folder in above
        ):
            raise _in_the_way(target / name)
    for name in foreign_files:
        (new / name).parent.mkdir(parents=True, exist_ok=True)
        _link(target / name, new / name)


def _link(source: Path, target: Path) -> None:
    try:
        os.link(source, target, follow_symlinks=False)
    except OSError:  # a file system without hard links
        shutil.copy2(source, target, follow_symlinks=False)


def _in_the_way(path: Path) -> StorageError:
    return StorageError(
        f"{path} was not written by scenefw, but a result of this name would replace it; {_REMEDY}"
    )


def _foreign_files(folder: Path, manifest: dict[str, str]) -> list[str]:
    """Names of the files there that scenefw didn't write, or that were changed since."""
    names = [name for name in _names(folder) if name != MANIFEST]
    return [
        name for name in names if name not in manifest or _digest(folder / name) != manifest[name]
    ]


def _names(folder: Path) -> Iterator[str]:
    """Of all files below a folder; a link is a file, wherever it points."""
    for path, folders, files in os.walk(folder):
        links = [name for name in folders if (Path(path) / name).is_symlink()]
        for name in sorted([*files, *links]):
            yield (Path(path) / name).relative_to(folder).as_posix()


def _digests(folder: Path) -> dict[str, str]:
    return {name: _digest(folder / name) for name in _names(folder)}


def _digest(path: Path) -> str:
    """SHA-256 of a plain file; of anything else where a link points, or nothing."""
    if path.is_symlink():
        return f"link to {path.readlink()}"
    if not path.is_file():
        return ""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _write_manifest(folder: Path, digests: dict[str, str]) -> None:
    content = {"note": _NOTE, "files": dict(sorted(digests.items()))}
    write_text(folder / MANIFEST, json.dumps(content, indent=1) + "\n")


def _listed(folder: Path) -> dict[str, str] | None:
    """What the manifest of a folder lists; None without one that can be read."""
    try:
        content = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        return {str(name): str(digest) for name, digest in content["files"].items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
