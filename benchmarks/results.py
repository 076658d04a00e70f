"""The ledger of results: what each page in docs/results measured, on which data, how often.

    python -m benchmarks.results              prints the tables, the weights that ship first
    python -m benchmarks.results --write      makes docs/results/README.md of them

`docs/results/ledger.jsonl` has a line for each run of a page, in the order of the tables.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.trainings import markdown
from scenefw.config import squash
from scenefw.core.errors import ConfigError, SceneFWError
from scenefw.core.files import write_text

FOLDER = Path(__file__).parents[1] / "docs" / "results"
LEDGER, DOCUMENT = FOLDER / "ledger.jsonl", FOLDER / "README.md"
HEADING = ["page", "data", "split", "times evaluated", "weights", "commit"]
GROUPS = {True: "Weights that ship", False: "Other weights", None: "Data sets"}
TEXT = """# Results

Each page has at its top the command that wrote it, the seed, the commit and the SHA-256 of the
weights, of which these tables show the first ten digits. "2 of 53" means that the split was
evaluated twice for this page, and 53 times for all pages of the same scenes; "–" means that
nobody counted. The split "none" marks real images that were seen while rules and weights were
chosen; they are no test.

[What was looked at how often](../history/results.md) has the changes that followed a look at
figures, [Contributing](../../CONTRIBUTING.md#new-weights) the way to renew pages. This page is
made of [a ledger](ledger.jsonl) by `python -m benchmarks.results --write`; don't edit it.

{tables}## Inputs

Commands of some pages read what these make:

```
{commands}
```
"""


@dataclass(frozen=True)
class Result:
    """A line of the ledger.

    Args:
        page: file name in docs/results.
        command: that wrote it, as it was run, without `report.publish`.
        data: images or scenes, and how many.
        split: val, test, all, or none for real images that were seen before.
        evaluated: times for this page, one for each kind of data if they differ; None: unknown.
        weights: first ten hexadecimal digits of the SHA-256, by name.
        ships: whether figures are of the weights that ship; None: of no weights.
        commit: first ten digits, as the page has it.
        together: times that all pages of the same scenes have evaluated them; None: unknown.
        before: commands that make what `command` reads.
    """

    page: str
    command: str
    data: str
    split: str
    evaluated: int | Sequence[int] | None
    weights: dict[str, str]
    ships: bool | None
    commit: str
    together: int | None = None
    before: Sequence[str] = ()

    def row(self) -> list[str]:
        """Its cells, in the order of the heading."""
        counts = [self.evaluated] if isinstance(self.evaluated, int) else self.evaluated or ()
        times = " and ".join(map(str, counts)) or "–"
        times += f" of {self.together}" if self.together else ""
        weights = ", ".join(f"{name} {digits}" for name, digits in self.weights.items()) or "–"
        link = f"[{self.page.removesuffix('.md')}]({self.page})"
        return [link, self.data, self.split, times, weights, self.commit]


def read(path: Path = LEDGER) -> list[Result]:
    """The lines of a ledger.

    Raises:
        ConfigError: the file is missing, or holds something else.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
        return [Result(**json.loads(line)) for line in lines]
    except (OSError, TypeError, ValueError) as error:
        raise ConfigError(f"the ledger {path} can't be read ({squash(error)})") from error


def document(results: Sequence[Result]) -> str:
    """The text of docs/results/README.md."""
    tables, pages = "", dict[str, list[str]]()
    for ships, title in GROUPS.items():
        rows = [result.row() for result in results if result.ships is ships]
        tables += f"## {title}\n\n{markdown([HEADING, *rows])}\n"
    for result in results:
        for command in result.before:
            pages.setdefault(command, []).append(result.page)
    commands = "\n".join(f"# {', '.join(of)}\n{command}" for command, of in pages.items())
    return TEXT.format(tables=tables, commands=commands)


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true")
    write = parser.parse_args().write
    try:
        text = document(read())
        write_text(DOCUMENT, text) if write else sys.stdout.write(text)
    except SceneFWError as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    main()
