"""What a dotted name stands for: a module, or something in one."""

from __future__ import annotations

import functools
import importlib
from typing import Any


def resolve(name: str) -> Any:
    """What `package.module.Class` names.

    `pkgutil.resolve_name` takes a module whose own imports fail for an attribute that is missing.

    Raises:
        ImportError: a module is missing, or one that it imports.
        AttributeError: the module has no such name.
    """
    parts = name.split(".")
    target: Any = importlib.import_module(parts[0])
    for end in range(2, len(parts) + 1):
        module = ".".join(parts[:end])
        try:
            target = importlib.import_module(module)
        except ModuleNotFoundError as error:
            if error.name != module:
                raise
            return functools.reduce(getattr, parts[end - 1 :], target)
    return target
