"""What an earlier run left in a folder, restored if the next run produces nothing there."""

from contextlib import suppress
from pathlib import Path

from scenefw.core.errors import StorageError
from scenefw.core.files import replacing

SETTINGS, RECORD, FIGURES = "config.yaml", "run.json", "metrics.json"
"""Files that every run writes."""


class Leftovers:
    """Notes the contents of a folder before a run.

    Args:
        folder: of the run; an empty `run.json`, by which a run takes a folder, doesn't count.
        keep_folder: it was named by the user, so it stays even if it is empty.
    """

    def __init__(self, folder: Path, *, keep_folder: bool = False) -> None:
        self.folder, self.keep_folder = folder, keep_folder
        self.times = self._modification_times()
        self.records = {
            name: content
            for name in (SETTINGS, RECORD, FIGURES)
            if (folder / name).is_file() and (content := (folder / name).read_bytes())
        }

    def restore(self) -> None:
        """Restores the earlier run's files or removes the folder, unless others are new."""
        if self._modification_times() != self.times:
            return
        for name in (SETTINGS, RECORD, FIGURES):
            if name in self.records:
                self._put_back(name)
            else:
                (self.folder / name).unlink(missing_ok=True)
        if not self.keep_folder:
            with suppress(OSError):  # it holds an earlier run
                self.folder.rmdir()

    def _put_back(self, name: str) -> None:
        with suppress(StorageError), replacing(self.folder / name) as temporary:
            temporary.write_bytes(self.records[name])  # a full disk has been reported already

    def _modification_times(self) -> dict[str, int]:
        """Modification times of all other files there."""
        if not self.folder.is_dir():
            return {}
        files = (f for f in self.folder.iterdir() if f.name not in (SETTINGS, RECORD, FIGURES))
        return {file.name: file.lstat().st_mtime_ns for file in files}
