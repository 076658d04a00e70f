"""Loggers of losses and validation scores (group `logger`)."""

import csv
import io
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from scenefw.core.files import append_text, replacing


class LossTable:
    """One flat CSV: step, epoch, seconds, name, value.

    A resumed training first drops the rows that come after its snapshot.

    Args:
        name: of the file in the training's folder.
    """

    def __init__(self, name: str = "losses.csv") -> None:
        self.name = name
        self._path = Path(name)

    def begin(self, folder: Path, step: int) -> None:
        """Starts the file, or cuts it back to where the training resumes."""
        self._path = folder / self.name
        rows = []
        if step and self._path.exists():
            with self._path.open(newline="", encoding="utf-8") as file:
                rows = [r for r in list(csv.reader(file))[1:] if int(r[0]) <= step]
        with replacing(self._path) as temporary, temporary.open("w", newline="") as file:
            csv.writer(file).writerows([["step", "epoch", "seconds", "name", "value"], *rows])

    def log(self, step: int, epoch: int, seconds: float, values: Mapping[str, float]) -> None:
        """Adds a row for each value."""
        place = [step, epoch, f"{seconds:.1f}"]
        rows = io.StringIO(newline="")
        csv.writer(rows).writerows([[*place, n, f"{v:.6g}"] for n, v in values.items()])
        append_text(self._path, rows.getvalue())

    def end(self) -> None:
        """Nothing is open."""


class TensorBoard:
    """Curves for `tensorboard --logdir FOLDER`; without the package, one line says so.

    A resumed training hides the values that come after its snapshot.

    Args:
        folder: of its files, in the training's folder.
    """

    def __init__(self, folder: str = "tensorboard") -> None:
        self.folder = folder
        self._writer: Any = None

    def begin(self, folder: Path, step: int) -> None:
        """Opens a file of events."""
        try:
            from torch.utils.tensorboard import SummaryWriter
        except ImportError:
            print(
                "no curves for TensorBoard, as the package is missing: pip install tensorboard, or "
                "leave it out with logger.tensorboard=null",
                file=sys.stderr,
            )
            return
        self._writer = SummaryWriter(
            str(folder / self.folder), purge_step=step + 1 if step else None
        )

    def log(self, step: int, epoch: int, seconds: float, values: Mapping[str, float]) -> None:
        """Adds a point to each curve."""
        if self._writer is not None:
            for name, value in values.items():
                self._writer.add_scalar(name, value, step)

    def end(self) -> None:
        """Writes what is left."""
        if self._writer is not None:
            self._writer.close()
            self._writer = None
