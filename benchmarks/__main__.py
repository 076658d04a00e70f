"""`python -m benchmarks [--json FILE] [--only TEXT]`: jobs of benchmarks/*.py and peers."""

import argparse
import importlib
import json
from pathlib import Path

from rich.console import Console
from rich.table import Table

from benchmarks.harness import Job, Row, measure_all
from scenefw import plugins
from scenefw.core.files import write_text

_NOT_JOBS = {"__init__", "__main__", "harness"}


def find_jobs() -> list[Job]:
    """The jobs of all files beside this one, in the order of the file names."""
    plugins.activate()
    files = sorted(Path(__file__).parent.glob("*.py"))
    modules = [
        importlib.import_module(f"benchmarks.{f.stem}") for f in files if f.stem not in _NOT_JOBS
    ]
    return [job for module in modules for job in getattr(module, "JOBS", ())]


def table_of(rows: list[Row]) -> Table:
    """The table that is printed."""
    table = Table("job", "peer", title="medians; ratio = peer / ours, above 1: ours is faster")
    for heading in ("ours (ms)", "peer (ms)", "ratio"):
        table.add_column(heading, justify="right")
    for row in rows:
        theirs = str(row.get("note") or _number(row["peer_ms"]))
        name, peer = str(row["job"]), str(row["peer"] or "none")
        table.add_row(name, peer, _number(row["ours_ms"]), theirs, _number(row["ratio"]))
    return table


def _number(value: str | float | None) -> str:
    return "" if value is None else f"{value:.2f}"


def main() -> None:
    """Measures, prints and, if asked, writes the rows."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the rows here")
    parser.add_argument("--only", default="", metavar="TEXT", help="jobs whose name contains TEXT")
    options = parser.parse_args()
    jobs = [job for job in find_jobs() if options.only in job.name]
    console = Console()
    with console.status("") as status:
        rows = measure_all(jobs, status.update)
    console.print(table_of(rows))
    if options.json:
        write_text(options.json, json.dumps(rows, indent=1) + "\n")
        console.print(str(options.json))


if __name__ == "__main__":
    main()
