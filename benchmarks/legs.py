"""One leg of a training: where it starts from, the command that runs it, what came of it."""

import csv
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from benchmarks.trainings import HERE, STATE, Ledger, Machine, Training
from scenefw.core.errors import CheckpointError
from scenefw.core.versions import versions
from scenefw.learning.provenance import read_provenance
from scenefw.learning.runtime.state import read_state

WARMUP = 500
"""Steps over which the rate rises where weights meet a fresh optimiser, as in scale=thesis."""
ALONE = {"OMP_WAIT_POLICY": "PASSIVE"} | dict.fromkeys(
    ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"
)
"""Environment of one core, whose waiting thread sleeps."""
_PREVIOUS, _DAMAGED = "previous.ckpt", "damaged.ckpt"


@dataclass(frozen=True)
class Start:
    """Where a leg starts from.

    Args:
        samples: that the training has seen.
        steps: of its state.
        words: overrides that make it start there.
        line: the same in words.
    """

    samples: int
    steps: int
    words: Sequence[str]
    line: str


def start_of(training: Training, folder: Path) -> Start:
    """The newest good state in a folder, else weights that ship, else nothing.

    A good state is kept as `previous.ckpt` while the leg replaces it; a damaged one is moved aside.
    """
    state, previous = folder / STATE, folder / _PREVIOUS
    for path in (state, previous):
        if not path.exists():
            continue
        try:
            progress = read_state(path, mapped=True)["scenefw"]
            seen, steps = progress["samples_seen"], progress["batches_seen"]
        except (CheckpointError, KeyError) as error:
            print(f"{training.name}: {error}; it is kept as {_DAMAGED}", flush=True)
            path.replace(folder / _DAMAGED)
            continue
        if path == state:
            previous.unlink(missing_ok=True)
            os.link(state, previous)
        else:
            shutil.copyfile(previous, state)
        earlier = _samples_of(progress.get("started_from"))
        words = [f"learning.schedule.warmup={WARMUP}"] if earlier else []
        return Start(seen + earlier, steps, words, f"goes on from {seen + earlier} samples")
    if training.weights:
        weights = HERE.parent / training.weights
        samples = _samples_of(read_provenance(weights).metadata)
        words = [f"learning.initial={weights}", f"learning.schedule.warmup={WARMUP}"]
        line = (
            f"no state in {folder}: starts from {weights.name} ({samples} samples) with a fresh "
            f"optimiser and {WARMUP} steps of warm-up"
        )
        return Start(samples, 0, words, line)
    return Start(0, 0, [], "starts from the beginning")


def _samples_of(facts: Mapping[str, Any] | None) -> int:
    """Samples of a training, and of those whose weights it and its predecessors started from."""
    if not facts:
        return 0
    return int(facts.get("samples", 0)) + _samples_of(facts.get("started_from"))


def command(
    training: Training, machine: Machine, start: Start, folder: Path, seconds: float
) -> list[str]:
    """The command of a leg that ends within so many seconds."""
    hours, rest = divmod(int(seconds), 3600)
    limit = f"{hours // 24:02d}:{hours % 24:02d}:{rest // 60:02d}:{rest % 60:02d}"
    places = (f"paths.training={folder}", f"paths.output={folder / 'run'}")
    words = [*training.words(machine), *start.words, f"trainer.max_time={limit}", *places]
    return [sys.executable, "-m", "scenefw", *words]


def make_needed(
    training: Training, home: Path, seconds: float, limits: Mapping[str, str] = ALONE
) -> None:
    """Makes the data that a training needs, unless they are there.

    Args:
        training: that needs them.
        home: its files are named from here.
        seconds: it may take.
        limits: of threads, as environment variables.

    Raises:
        subprocess.CalledProcessError: they can't be made; what failed is printed.
        subprocess.TimeoutExpired: time is over; the next call goes on.
    """
    for file, words in training.needs.items():
        if not (home / file).exists():
            print(f"{training.name} needs {file}: {' '.join(words)}", flush=True)
            made = [sys.executable, "-m", "scenefw", *words]
            environment = {**os.environ, **limits}
            subprocess.run(made, cwd=home, env=environment, check=True, timeout=seconds)


def record(
    training: Training,
    ledger: Ledger,
    folder: Path,
    start: Start,
    machine: str,
    figures: Mapping[str, float],
) -> dict[str, Any]:
    """Adds the line of a leg that ended to the ledger, from what it left in its folder."""
    state = read_state(folder / STATE, mapped=True)["scenefw"]
    end = state["samples_seen"] + _samples_of(state.get("started_from"))
    steps = max(state["batches_seen"] - start.steps, 1)
    per_step = (end - start.samples) / steps
    curve = [
        [round(start.samples + (step - start.steps) * per_step), value]
        for step, value in validations(folder / "losses.csv", training.figure)
        if step > start.steps
    ]
    leg = {
        "training": training.name,
        "date": f"{datetime.now(UTC):%Y-%m-%d %H:%M}",
        "commit": versions().get("commit"),
        "machine": machine,
        "samples": [start.samples, end],
        "samples_per_second": round(
            figures.get("train/samples_per_second")
            or per_step * steps_per_second(folder / "losses.csv", start.steps),
            2,
        ),
        "waiting_for_data": round(figures.get("train/share_of_data", 0.0), 3),
        "curve": curve,
        "validation": {n: round(v, 5) for n, v in figures.items() if n.startswith("val/")},
    }
    ledger.add(leg)
    return leg


def figures_of(folder: Path) -> dict[str, float]:
    """What the leg in a folder measured; nothing if it was killed before it wrote that."""
    try:
        return json.loads((folder / "run" / "metrics.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


def steps_per_second(table: Path, first_step: int) -> float:
    """Of a leg that was stopped before it said how fast it was; 0 without two lines of it."""
    if not table.exists():
        return 0.0
    with table.open(newline="", encoding="utf-8") as file:
        rows = [(int(row["step"]), float(row["seconds"])) for row in csv.DictReader(file)]
    rows = [row for row in rows if row[0] > first_step]
    if not rows or rows[-1][1] == rows[0][1]:
        return 0.0
    return (rows[-1][0] - rows[0][0]) / (rows[-1][1] - rows[0][1])


def validations(table: Path, figure: str) -> list[tuple[int, float]]:
    """Steps and values of a validation figure in a table of losses."""
    if not table.exists():
        return []
    with table.open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["name"] == figure]
    return [(int(row["step"]), round(float(row["value"]), 5)) for row in rows]
