"""Goes on with the training that is most overdue, on one core, beside other work.

    python -m benchmarks.train_next --minutes 150
    python -m benchmarks.train_next --minutes 10 --training thesis_simstack --ledger MINE.yaml

It resumes from the state in the user's cache folder, ends in time, and adds a line to the ledger.
Killed at any moment it loses what came after the last snapshot, three minutes at most.
"""

import argparse
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from benchmarks.legs import ALONE, command, figures_of, make_needed, record, start_of
from benchmarks.trainings import LEDGER, Ledger, Training, states_folder
from scenefw.core.errors import ConfigError, SceneFWError

_NICENESS = 10
_AROUND = 30.0
"""Seconds of a call outside the time that the training counts: imports before, its line after."""


def train(ledger: Ledger, training: Training, minutes: float) -> int:
    """Runs a leg; returns its exit status.

    Raises:
        ConfigError: there is no time to train.
    """
    if 60 * minutes <= _AROUND:
        raise ConfigError(
            f"--minutes {minutes:g} leaves no time to train: imports and the last snapshot take "
            f"{_AROUND / 60:g}; give more"
        )
    end = time.monotonic() + 60 * minutes - _AROUND
    home = states_folder()
    folder = home / training.name
    folder.mkdir(parents=True, exist_ok=True)
    try:
        make_needed(training, home, end - time.monotonic())
    except subprocess.TimeoutExpired:
        print(f"{training.name}: time is over while its data are made; the next call goes on")
        return 0
    except subprocess.CalledProcessError as failure:
        return failure.returncode
    start = start_of(training, folder)
    print(f"{training.name}: {start.line}", flush=True)
    words = command(training, training.core, start, folder, end - time.monotonic())
    with subprocess.Popen(
        [*words, "trainer.accelerator=cpu", "device=cpu", "threads=1"],
        cwd=home,
        env=os.environ | ALONE | _plugins(),
        preexec_fn=lambda: os.nice(_NICENESS),
    ) as process:
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda n, _: process.send_signal(n))
        status = process.wait()
    if status not in (0, 130, 143):
        return status
    leg = record(training, ledger, folder, start, "a core", figures_of(folder))
    began, ended = leg["samples"]
    print(f"{training.name}: {began} to {ended} samples, {leg['validation']}")
    print(folder)
    return status


def _plugins() -> dict[str, str]:
    """Plugins of the folder in which the queue was called; trainings run in their own."""
    listed = [os.environ.get("SCENEFW_PLUGINS", ""), str(Path("plugins").resolve())]
    return {"SCENEFW_PLUGINS": os.pathsep.join(filter(None, listed))}


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, required=True)
    parser.add_argument("--training", metavar="NAME")
    parser.add_argument("--ledger", type=Path, default=LEDGER)
    options = parser.parse_args()
    try:
        ledger = Ledger(options.ledger)
        overdue = ledger.overdue()
        if options.training:
            overdue = [ledger.training(options.training)]
        if not overdue:
            print("all trainings are finished")
            return
        sys.exit(train(ledger, overdue[0], options.minutes))
    except SceneFWError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
