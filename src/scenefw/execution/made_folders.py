"""Folders that Hydra makes for a command; those that stay empty go when it ends."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hydra.experimental.callback import Callback

_SWEEP = "multirun.yaml"  # Hydra writes it before the first run of a sweep


@dataclass
class _Noted:
    """What there was before.

    Args:
        missing_folders: the folder of the command and those above it that weren't there, innermost
            first.
        sweep: the folder of a sweep.
        entries: what it held.
    """

    missing_folders: list[Path] = field(default_factory=list)
    sweep: Path | None = None
    entries: set[Path] = field(default_factory=set)


_noted = _Noted()


class MadeFolders(Callback):
    """Notes which folders are missing before Hydra makes those of a run or a sweep.

    Hydra makes them before scenefw can look at the settings, so even for a command that is refused.
    """

    def on_run_start(self, config: Any, **_: Any) -> None:
        """Hydra calls it with all settings."""
        _noted.missing_folders = _missing_folders(Path(config.hydra.run.dir))

    def on_multirun_start(self, config: Any, **_: Any) -> None:
        """Hydra calls it with all settings."""
        _noted.sweep = Path(config.hydra.sweep.dir).absolute()
        _noted.missing_folders = _missing_folders(_noted.sweep)
        _noted.entries = set(_noted.sweep.iterdir()) if _noted.sweep.is_dir() else set()


@contextmanager
def empty_ones_removed() -> Iterator[None]:
    """Hydra runs within the block; after it, folders that it made are gone if they hold nothing.

    A sweep's record counts for nothing where no run left a file.
    """
    try:
        yield
    finally:
        if _noted.sweep is not None:
            _clear_sweep(_noted.sweep)
        for folder in _noted.missing_folders:
            _remove(folder)


def _clear_sweep(sweep: Path) -> None:
    with suppress(OSError):  # it was never made
        for entry in set(sweep.iterdir()) - _noted.entries:
            _remove(entry)
        if set(sweep.iterdir()) - _noted.entries == {sweep / _SWEEP}:
            (sweep / _SWEEP).unlink()


def _remove(folder: Path) -> None:
    with suppress(OSError):  # it holds something, or is gone
        folder.rmdir()


def _missing_folders(folder: Path) -> list[Path]:
    folder = folder.absolute()
    return [path for path in (folder, *folder.parents) if not path.exists()]
