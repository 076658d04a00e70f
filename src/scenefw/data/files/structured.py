"""JSON and YAML from outside, parsed without running code, OpenCV's dialect of YAML included."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import yaml

from scenefw.core.errors import InputError

if TYPE_CHECKING:
    from pathlib import Path

_MAX_BYTES = 10_000_000
"""Metadata of a recording of an hour is smaller; what is larger is another kind of file."""

_OPENCV_HEADER = re.compile(r"\A%YAML:(\d)\.(\d)")
_OPENCV_MATRIX = "tag:yaml.org,2002:opencv-matrix"


class _Loader(yaml.SafeLoader):
    """Safe, knows OpenCV's matrices, and refuses references, which can grow without end."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("references (*name) are not read; write the values out")
        return super().compose_node(parent, index)


_Loader.add_constructor(_OPENCV_MATRIX, lambda loader, node: loader.construct_mapping(node, True))


def read_text(path: Path) -> str:
    """The text of a small file, whether it is UTF-8 or Latin-1.

    Raises:
        InputError: it can't be read, is no plain file, or too large.
    """
    try:
        if not path.is_file():
            raise InputError(f"{path} is no plain file; give a text file")
        if path.stat().st_size > _MAX_BYTES:
            raise InputError(
                f"{path} has {path.stat().st_size / 1e6:.0f} MB, expected at most "
                f"{_MAX_BYTES / 1e6:.0f}; is it another kind of file?"
            )
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror or error}") from error
    if b"\0" in data:
        raise InputError(f"{path} is no text; expected a text file in UTF-8")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def read_structured(path: Path) -> Any:
    """What a .json, .yaml or .yml file holds; .intr is JSON.

    Raises:
        InputError: it is no such text, nested without end, or refers to itself.
    """
    text = read_text(path)
    try:
        if path.suffix.lower() in (".yaml", ".yml"):
            text = _OPENCV_HEADER.sub(r"%YAML \1.\2", text)
            documents = [d for d in yaml.load_all(text, Loader=_Loader) if d is not None]
            if len(documents) > 1:
                raise InputError(f"{path} holds {len(documents)} documents of YAML; give one")
            return documents[0] if documents else None  # of a SafeLoader
        return json.loads(text)
    except (ValueError, yaml.YAMLError, RecursionError, OverflowError, MemoryError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise InputError(f"cannot read {path}: {reason}; is it damaged?") from error
