"""Trains what is most overdue on a GPU, several trainings at once where one doesn't fill it.

    python -m benchmarks.train_on_gpu OUTPUT [--limit 570] [--from FOLDER] [--training NAME ...]

The whole time of `--limit` (seconds) is used. States come from the parts in `--from`
(`benchmarks.travel pack`), else each training starts as on a core. OUTPUT gets states, weights and
losses in files of 15 MB; on the other machine

    python -m benchmarks.train_on_gpu OUTPUT --receive

puts states in place and adds the legs to the ledger. `--trainer cpu` tries all this without a GPU.
"""

import argparse
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import torch

from benchmarks.legs import Start, command, figures_of, make_needed, record, start_of
from benchmarks.trainings import LEDGER, STATE, Ledger, Training, states_folder
from benchmarks.travel import pack, unpack
from scenefw.core.errors import SceneFWError, TrainingError
from scenefw.core.files import replacing

COLLECTING = 40.0
"""Seconds for reading, packing and copying states once the trainings have ended."""


def chosen(ledger: Ledger, names: Sequence[str]) -> list[Training]:
    """Trainings that fill a GPU together, the most overdue first."""
    room, trainings = 1.0, list[Training]()
    for training in [ledger.training(name) for name in names] or ledger.overdue():
        if names or not trainings or training.gpu.part <= room + 1e-6:
            trainings.append(training)
            room -= training.gpu.part
    return trainings


def train(
    trainings: Sequence[Training], home: Path, end: float, trainer: str
) -> tuple[dict[str, Start], dict[str, int]]:
    """Runs a leg of each beside the others; where they started, and their exit statuses."""
    cores = max((os.cpu_count() or 1) // len(trainings), 1)
    limits = dict.fromkeys(("OMP_NUM_THREADS", "NUMBA_NUM_THREADS"), str(cores))
    starts, running = {}, {}
    for training in trainings:
        folder = home / training.name
        folder.mkdir(parents=True, exist_ok=True)
        starts[training.name] = start_of(training, folder)
        print(f"{training.name}: {starts[training.name].line}", flush=True)
        machine = training.gpu if trainer == "gpu" else training.core
        left = end - time.monotonic()
        words = [*command(training, machine, starts[training.name], folder, left)]
        words += [f"trainer={trainer}", f"threads={cores}"]
        environment = _toolkit() | os.environ | limits | {"OMP_WAIT_POLICY": "PASSIVE"}
        running[training.name] = subprocess.Popen(words, cwd=home, env=environment)
    return starts, {name: process.wait() for name, process in running.items()}


def bring_back(
    starts: Mapping[str, Start], home: Path, output: Path, megabytes: float
) -> dict[str, str]:
    """Packs states, weights and losses of all trainings that have a state; the form of each."""
    extra: dict[str, Any] = {"machine": _machine(), "legs": {}}
    states = {}
    for name, start in starts.items():
        folder = home / name
        if not (folder / STATE).exists():
            continue
        states[name] = folder / STATE
        files = [folder / "losses.csv", folder / f"{name}.safetensors"]
        extra["legs"][name] = {
            "start": [start.samples, start.steps, list(start.words), start.line],
            "figures": figures_of(folder),
            "files": {file.name: file.read_bytes() for file in files if file.exists()},
        }
    return pack(states, output, megabytes, extra)


def receive(output: Path, ledger: Ledger, home: Path) -> None:
    """Puts what came back in place, and adds its legs to the ledger."""
    forms, extra = unpack(output, home)
    for name, leg in extra["legs"].items():
        for file, content in leg["files"].items():
            with replacing(home / name / file) as temporary:
                temporary.write_bytes(content)
        training, start = ledger.training(name), Start(*leg["start"])
        line = record(training, ledger, home / name, start, extra["machine"], leg["figures"])
        print(f"{name}: {line['samples']} samples, state {forms[name]}, {line['validation']}")


def _toolkit() -> dict[str, str]:
    """Where numba finds CUDA's compiler if neither wheels nor the user say so."""
    nvcc = shutil.which("nvcc")
    folders = [Path(nvcc).resolve().parents[1]] if nvcc else []
    for folder in (*folders, Path("/usr/local/cuda")):
        if (folder / "nvvm").is_dir() and not os.environ.get("CUDA_PATH"):
            return {"CUDA_HOME": str(folder)}
    return {}


def _machine() -> str:
    return torch.cuda.get_device_name() if torch.cuda.is_available() else "a CPU"


def main() -> None:
    """The command line."""
    began = time.monotonic()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("output", type=Path)
    parser.add_argument("--limit", type=float, default=570.0)
    parser.add_argument("--from", dest="source", type=Path)
    parser.add_argument("--training", nargs="+", default=[])
    parser.add_argument("--trainer", choices=("gpu", "cpu"), default="gpu")
    parser.add_argument("--megabytes", type=float, default=60.0)
    parser.add_argument("--receive", action="store_true")
    parser.add_argument("--ledger", type=Path, default=LEDGER)
    options = parser.parse_args()
    home = states_folder()
    try:
        ledger = Ledger(options.ledger)
        if options.receive:
            receive(options.output, ledger, home)
            return
        if options.source:
            unpack(options.source, home)
        trainings = chosen(ledger, options.training)
        end = began + options.limit - COLLECTING
        for training in trainings:  # data that travelled with the checkout
            for file in training.needs:
                if not (home / file).exists() and Path(file).exists():
                    (home / file).parent.mkdir(parents=True, exist_ok=True)
                    shutil.copyfile(file, home / file)
            make_needed(training, home, end - time.monotonic(), {})
        starts, statuses = train(trainings, home, end, options.trainer)
        options.output.mkdir(parents=True, exist_ok=True)
        forms = bring_back(starts, home, options.output, options.megabytes)
        for name, status in statuses.items():
            print(f"{name}: exit status {status}, state {forms.get(name, 'none')}")
        if any(statuses.values()):
            raise TrainingError("a training failed; its newest good state is kept")
    except (SceneFWError, subprocess.SubprocessError) as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
