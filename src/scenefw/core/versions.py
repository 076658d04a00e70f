"""Versions of installed packages, and the commit of a checkout."""

import hashlib
import platform
import subprocess
import tomllib
from collections.abc import Iterable
from functools import cache
from importlib import metadata
from pathlib import Path

_PACKAGE = Path(__file__).parents[1]
_PROJECT = Path(__file__).parents[3] / "pyproject.toml"
_RECORDED = ("scenefw", "torch", "lightning", "numpy", "numba", "hydra-core")


def installed(names: Iterable[str]) -> dict[str, str]:
    """Versions by name, without packages that are not installed.

    A checkout of scenefw that nobody has installed is asked for its own (`PYTHONPATH=src`).
    """
    releases = {}
    for name in names:
        try:
            releases[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            if name == "scenefw" and _PROJECT.is_file():
                releases[name] = tomllib.loads(_PROJECT.read_text())["project"]["version"]
    return releases


def versions() -> dict[str, str]:
    """Versions of what computes, and the git commit if the project is a checkout."""
    return dict(_versions())


@cache
def _versions() -> dict[str, str]:
    """Of this process: a folder of images asks for every scene."""
    releases = {"python": platform.python_version()} | installed(_RECORDED)
    commit = _commit(_PROJECT.parent)
    return releases | ({"commit": commit} if commit else {})


def sources() -> str:
    """SHA-256 of the code of scenefw, and of the plugins of its checkout, as it lies on the disk.

    The commit of a checkout doesn't tell what was changed since.
    """
    digest = hashlib.sha256()
    plugins = [_PROJECT.parent / "plugins"] if _PROJECT.is_file() else []
    for folder in (_PACKAGE, *plugins):
        for file in sorted(folder.rglob("*.py")):
            digest.update(str(file.relative_to(folder)).encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def _commit(root: Path) -> str | None:
    if not (root / ".git").exists():
        return None
    command = ["git", "-C", str(root), "rev-parse", "HEAD"]
    try:
        answer = subprocess.run(command, capture_output=True, text=True, timeout=5, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return answer.stdout.strip()
