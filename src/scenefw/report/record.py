"""What a run's folder says of the run."""

import json
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def read_record(folder: Path) -> dict[str, Any]:
    """What the run's folder says of it: seed, versions, command line (`run.json`), or nothing."""
    path = folder / "run.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}


def command_line(record: Mapping[str, Any]) -> str:
    """The command of a run's record as one would type it elsewhere, without where results went."""
    words = [w for w in record.get("command", ()) if not w.startswith(("paths.", "report.publish"))]
    return " ".join(["python -m scenefw", *map(shlex.quote, words)])
