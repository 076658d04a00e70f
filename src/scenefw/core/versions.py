"""Versions of the packages at hand."""

import tomllib
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path

_PROJECT = Path(__file__).parents[3] / "pyproject.toml"


def installed(names: Iterable[str]) -> dict[str, str]:
    """Versions by name, without packages that are not installed.

    A checkout of scenefw that nobody has installed is asked for its own (`PYTHONPATH=src`).
    """
    found = {}
    for name in names:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            if name == "scenefw" and _PROJECT.is_file():
                found[name] = tomllib.loads(_PROJECT.read_text())["project"]["version"]
    return found
