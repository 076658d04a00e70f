"""Where a run reads and writes: what can only be a slip is an error before anything is lost."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from scenefw.core.assets import image_path
from scenefw.core.errors import ConfigError, InputError, StorageError
from scenefw.core.measures import MEASURES_FILE
from scenefw.execution.leftovers import FIGURES, RECORD, SETTINGS
from scenefw.renamed_settings import instead_of
from scenefw.report.record import PAGE, read_record

if TYPE_CHECKING:
    from omegaconf import DictConfig

KEPT = "kept"
"""Key of a run's record: names of files that were in its folder before the first run."""

_WRITTEN = (RECORD, SETTINGS, FIGURES, MEASURES_FILE, PAGE)
_RECORD_KEYS = {"seed", "versions", "command"}


def require_values(overrides: Sequence[str]) -> None:
    """Refuses settings without a value: an empty path would mean the current folder.

    Raises:
        ConfigError: a word ends with its equals sign, as `paths.output=$FOLDER` of a shell where
            that is not set; or a path is a quoted empty text, which other settings may be; or it
            chooses from a group that is a setting now, in whose place it would be put.
    """
    for word in overrides:
        key, equals, value = word.partition("=")
        instead = instead_of(key, value)
        if instead is not None:
            raise ConfigError(f"{word} was deleted; give {instead}")
        quoted = value.strip() in ("''", '""') and key.partition(".")[0] in ("input", "paths")
        if equals and (quoted or not value.strip()) and not key.startswith("hydra"):
            raise ConfigError(f"{key}= has no value; give {key}=VALUE, or leave it out")


def require_input(config: DictConfig) -> None:
    """Looks for the input before anything heavy is imported, which takes seconds.

    Raises:
        InputError: it is not there.
    """
    source = config.get("input")
    ours = str(config.run.get("_target_")).startswith("scenefw.")  # a plugin may mean no path
    if ours and isinstance(source, str) and not image_path(source).exists():
        raise InputError(f"no file or folder {source}; {_path_advice(source)}")


def _path_advice(source: str) -> str:
    """What to type in place of a path that isn't there, and has signs of another notation."""
    if "$" in source:
        return "shells put in $NAME outside single quotes only; give the whole path"
    if "://" in source:
        return "addresses are not read; give input=PATH of a file or a folder"
    if set("*?") & set(source):
        return "patterns are not read; give input=FOLDER with the images"
    return "give input=PATH of one that is there"


def strangers(output: Path) -> list[Path]:
    """Files of somebody else: those that were in a folder before the first run there."""
    if not output.is_dir():
        return []
    files = [file for file in output.iterdir() if not file.is_dir()]
    names = _kept_before(output)
    return files if names is None else [file for file in files if file.name in names]


def _kept_before(output: Path) -> list[str] | None:
    """Names that the record of a run lists; None if the folder has no such record."""
    try:
        if not (output / RECORD).stat().st_size:  # just taken by a run
            return []
        record = read_record(output)
    except (OSError, ValueError):
        return None
    is_record = isinstance(record, dict) and record.keys() >= _RECORD_KEYS
    return list(record.get(KEPT, [])) if is_record else None


def require_no_strangers(output: Path) -> None:
    """Refuses a folder that is no run's but holds a file of a name that every run writes.

    Raises:
        StorageError: it does.
    """
    names = {file.name for file in strangers(output)}
    clash = next((name for name in _WRITTEN if name in names), None)
    if clash is not None:
        raise StorageError(
            f"{output / clash} is not of a run of scenefw (there is no {RECORD} of one), and would "
            "be lost; give another paths.output, or move it away"
        )
