"""The ledger of results: what each page in docs/results measured, on which data, how often.

    python -m benchmarks.results              prints the tables, the weights that ship first
    python -m benchmarks.results --write      makes docs/results/README.md of them
    python -m benchmarks.results --renew osd real --inputs FOLDER
                                              runs pages anew and counts it; commands read FOLDER

`docs/results/ledger.jsonl` has a line for each run of a page, in the order of the tables.
"""

import argparse
import json
import shlex
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
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


def write(results: Sequence[Result], path: Path = LEDGER) -> None:
    """Writes the lines of a ledger; what is not said takes no place."""
    defaults = {"together": None, "before": ()}
    lines = [
        {k: v for k, v in asdict(result).items() if k not in defaults or v != defaults[k]}
        for result in results
    ]
    write_text(path, "".join(f"{json.dumps(line, ensure_ascii=False)}\n" for line in lines))


def renew(page: str, inputs: Path, ledger: Path = LEDGER) -> None:
    """Runs the command of a page anew, and writes page and ledger.

    Args:
        page: its name without `.md`.
        inputs: the folder in which the command finds its inputs.
        ledger: its file, beside the pages.

    Raises:
        ConfigError: the ledger has no such page, or the page is made of several runs.
        subprocess.CalledProcessError: the command failed; it has said why.
    """
    results, name = read(ledger), f"{page}.md"
    rows = [number for number, result in enumerate(results) if result.page == name]
    if len(rows) != 1:
        raise ConfigError(f"the ledger has {len(rows)} runs of {name}; one can be renewed")
    before = results[rows[0]]
    output = ledger.parents[2] / "outputs" / "figures" / page
    words = [sys.executable, *shlex.split(before.command)[1:], f"paths.output={output}"]
    subprocess.run([*words, f"report.publish={ledger.parent / name}"], cwd=inputs, check=True)
    facts = json.loads((output / "run.json").read_text(encoding="utf-8"))
    weights = {Path(file).stem: digest[:10] for file, digest in facts["weights"].items()}
    after = replace(before, weights=weights, commit=facts["versions"]["commit"][:10], ships=True)
    if isinstance(before.evaluated, int):
        after = replace(after, evaluated=before.evaluated + 1)
    results[rows[0]] = after
    if before.together:  # all pages of these scenes
        looks = before.together + 1
        results = [
            replace(r, together=looks) if r.together == before.together else r for r in results
        ]
    write(results, ledger)


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
    parser.add_argument("--renew", nargs="+", metavar="PAGE", default=[])
    parser.add_argument("--inputs", type=Path, default=Path(), metavar="FOLDER")
    options = parser.parse_args()
    try:
        for page in options.renew:
            renew(page, options.inputs)
        text = document(read())
        is_written = options.write or options.renew
        write_text(DOCUMENT, text) if is_written else sys.stdout.write(text)
    except SceneFWError as error:
        sys.exit(f"error: {error}")
    except subprocess.CalledProcessError as error:
        sys.exit(error.returncode)


if __name__ == "__main__":
    main()
