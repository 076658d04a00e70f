"""The record in a run's folder."""

import json
import re
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

PAGE = "report.html"
_ABSOLUTE = re.compile(r"(^|[=\[,'\"])/(?:[^\s,=\[\]]*/)?([^/\s,=\[\]]+)")


def read_record(folder: Path) -> dict[str, Any]:
    """Seed, versions and command line from a run's folder (`run.json`); empty if there are none."""
    path = folder / "run.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}


def command_line(record: Mapping[str, Any]) -> str:
    """The command of a run's record as one would type it elsewhere.

    Where results went is left out, and of absolute paths, which are those of one machine, the last
    part alone is kept. A run of a sweep has its own settings, not those of the whole.
    """
    sweep = any(w in ("-m", "--multirun") for w in record.get("command", ()))
    words = record.get("overrides" if sweep else "command") or record.get("command", ())
    arguments = [w for w in words if not w.startswith(("paths.", "report.publish"))]
    return " ".join(["python -m scenefw", *map(shlex.quote, map(_elsewhere, arguments))])


def used_weights(record: Mapping[str, Any]) -> list[str]:
    """Files of weights that a run used, each with the beginning of its SHA-256."""
    return [f"{name} {digest[:10]}" for name, digest in record.get("weights", {}).items()]


def _elsewhere(word: str) -> str:
    return _ABSOLUTE.sub(r"\1\2", word)
