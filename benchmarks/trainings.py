"""The ledger of trainings: what is trained, how far each has come, and whose turn it is.

    python -m benchmarks.trainings              prints the table, the most overdue first
    python -m benchmarks.trainings --write      puts it into docs/training.md, as each leg does

`trainings.yaml` says what is trained; `legs.jsonl` has a line for each leg that was run. States lie
in the user's cache folder, or in $SCENEFW_TRAININGS, so that they outlive a checkout.
"""

import argparse
import json
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from omegaconf import OmegaConf
from yaml import YAMLError

from scenefw.config import squash
from scenefw.core.errors import ConfigError, SceneFWError
from scenefw.core.files import append_text, write_text

HERE = Path(__file__).parent
LEDGER = HERE / "trainings.yaml"
DOCUMENT = HERE.parent / "docs" / "training.md"
STATE = "last.ckpt"
_MARKS = ("<!-- trainings -->", "<!-- end of trainings -->")
_HOUR = 3600.0


@dataclass(frozen=True)
class Machine:
    """How a training runs on a core, or on a GPU.

    Args:
        samples_per_second: measured, also of a part of a GPU that it takes.
        changes: overrides of its legs there, such as the size of a batch.
        part: how much of the machine it fills, 1 = all.
    """

    samples_per_second: float
    changes: Sequence[str] = ()
    part: float = 1.0


@dataclass(frozen=True)
class Training:
    """An entry of the ledger.

    Args:
        name: of its folder and weights.
        purpose: one line.
        command: overrides that train it; its `paths.weights` is `name`.
        weight: part of the queue's time that it should get, relative to the others.
        samples: that its recipe asks for; of the thesis where it says so.
        figure: validation figure that stands for it.
        core, gpu: how it runs there.
        may_change: facts in which its legs may differ.
        needs: files that must be there first, and the overrides that make each.
        weights: of this recipe, which ship, by their path in the checkout: a start without a state.
    """

    name: str
    purpose: str
    command: Sequence[str]
    weight: float
    samples: int
    figure: str
    core: Machine
    gpu: Machine
    may_change: Sequence[str] = ("batch_size",)
    needs: Mapping[str, Sequence[str]] = field(default_factory=dict)
    weights: str = ""

    def words(self, machine: Machine) -> list[str]:
        """Overrides of a leg, without time and folders."""
        allowed = f"run.may_change=[{','.join(self.may_change)}]"
        return [*self.command, *machine.changes, allowed]


class Ledger:
    """Entries and legs of trainings.

    Args:
        path: of the entries, a YAML file; the legs are `legs.jsonl` beside it.

    Raises:
        ConfigError: a file is missing, or holds something else.
    """

    def __init__(self, path: Path = LEDGER) -> None:
        try:
            entries: Any = OmegaConf.to_container(OmegaConf.load(path))
            self.trainings = {name: _training(name, entry) for name, entry in entries.items()}
        except (OSError, TypeError, AttributeError, ValueError, KeyError, YAMLError) as error:
            line = squash(error)
            raise ConfigError(f"the ledger {path} can't be read ({line}); see {LEDGER}") from error
        self.path, self._legs = path, path.with_name("legs.jsonl")
        text = self._legs.read_text(encoding="utf-8") if self._legs.exists() else ""
        self.legs: list[dict[str, Any]] = [json.loads(line) for line in text.splitlines()]

    def training(self, name: str) -> Training:
        """An entry by its name.

        Raises:
            ConfigError: there is none.
        """
        if name not in self.trainings:
            raise ConfigError(f"no training {name}; the ledger has {', '.join(self.trainings)}")
        return self.trainings[name]

    def legs_of(self, name: str) -> list[dict[str, Any]]:
        """Its legs, the oldest first."""
        return [leg for leg in self.legs if leg["training"] == name]

    def samples(self, name: str) -> int:
        """Samples that a training has seen."""
        return max((leg["samples"][1] for leg in self.legs_of(name)), default=0)

    def hours(self, name: str) -> float:
        """The same in hours of a core."""
        return self.samples(name) / self.trainings[name].core.samples_per_second / _HOUR

    def overdue(self) -> list[Training]:
        """Trainings that aren't finished; first the one with the least time for its weight."""
        left = [t for t in self.trainings.values() if self.samples(t.name) < t.samples]
        return sorted(left, key=lambda t: self.hours(t.name) / t.weight)

    def add(self, leg: Mapping[str, Any]) -> None:
        """Appends a line; that of the project's own ledger changes the table in its document."""
        self.legs.append(dict(leg))
        append_text(self._legs, json.dumps(leg) + "\n")
        if self.path == LEDGER:
            write_into(DOCUMENT, self.table())

    def table(self) -> list[list[str]]:
        """Rows of the printed table, its heading first."""
        rows = [
            ["training", "weight", "core hours", "samples", "of the recipe", "a core", "a GPU"],
        ]
        rows[0] += ["figure", "first", "last", "x 10", "x 100"]
        for training in self.overdue() + self._finished():
            curve = self.curve(training.name)
            rows.append(
                [
                    training.name,
                    f"{training.weight:g}",
                    f"{self.hours(training.name):.1f}",
                    f"{self.samples(training.name)}",
                    f"{self.samples(training.name) / training.samples:.1%}",
                    f"{training.core.samples_per_second:g}/s",
                    f"{training.gpu.samples_per_second:g}/s",
                    training.figure.removeprefix("val/"),
                    _point(curve[0]) if curve else "",
                    _point(curve[-1]) if curve else "",
                    *(promise(curve, times) for times in (10, 100)),
                ]
            )
        return rows

    def curve(self, name: str) -> list[tuple[int, float]]:
        """Samples and the validation figure, over all legs."""
        points = [tuple(point) for leg in self.legs_of(name) for point in leg["curve"]]
        return sorted(dict(points).items())

    def _finished(self) -> list[Training]:
        return [t for t in self.trainings.values() if self.samples(t.name) >= t.samples]


def states_folder() -> Path:
    """Where states of trainings, and what they cache, are kept."""
    given = os.environ.get("SCENEFW_TRAININGS")
    cache = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    return Path(given) if given else cache / "scenefw" / "trainings"


def _training(name: str, entry: dict[str, Any]) -> Training:
    core, gpu = (Machine(**entry.pop(key)) for key in ("core", "gpu"))
    return Training(name, **entry, core=core, gpu=gpu)


def promise(curve: Sequence[tuple[int, float]], times: float) -> str:
    """A figure between 0 and 1 after so many times the samples, if its error goes on falling.

    The error, one minus the figure, is taken as a power of the number of samples (Hestness et al.
    2017), fitted where the last three quarters of the samples were seen. Trainings stay behind it
    where they have learnt what there is to learn.
    """
    late = [(n, value) for n, value in curve if 4 * n >= curve[-1][0] and 0 < value < 1]
    if len(late) < 3:
        return ""
    samples, values = np.log([n for n, _ in late]), np.log([1 - value for _, value in late])
    slope, level = np.polyfit(samples, values, 1)
    return f"{1 - np.exp(level + slope * (samples[-1] + np.log(times))):.2f}"


def _point(point: tuple[int, float]) -> str:
    return f"{point[1]:.3f} ({point[0]})"


def write_into(document: Path, rows: Sequence[Sequence[str]]) -> None:
    """Puts the table between the marks of a document.

    Raises:
        ConfigError: the document has no marks.
    """
    text = document.read_text(encoding="utf-8")
    begin, _, rest = text.partition(_MARKS[0])
    _, found, end = rest.partition(_MARKS[1])
    if not found:
        raise ConfigError(f"{document} has no {_MARKS[0]} ... {_MARKS[1]}; add both lines")
    write_text(document, f"{begin}{_MARKS[0]}\n{markdown(rows)}{_MARKS[1]}{end}")


def markdown(rows: Sequence[Sequence[str]]) -> str:
    """The table in Markdown."""
    heading, *others = rows
    lines = [heading, ["---"] * len(heading), *others]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def main() -> None:
    """The command line."""
    from rich.console import Console
    from rich.table import Table

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ledger", type=Path, default=LEDGER)
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    try:
        ledger = Ledger(options.ledger)
        heading, *rows = ledger.table()
        if options.write:
            write_into(DOCUMENT, [heading, *rows])
    except SceneFWError as error:
        sys.exit(f"error: {error}")
    table = Table(*heading, title=f"states: {states_folder()}")
    for row in rows:
        table.add_row(*row)
    Console().print(table)


if __name__ == "__main__":
    main()
