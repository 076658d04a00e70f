"""Words of a command line, brought into the order and the grammar that Hydra reads."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from scenefw.config import quoted
from scenefw.core.errors import ConfigError

_QUOTED = re.compile(r"""(["'])(~.*)\1""")
_LISTED = re.compile(r"(?:^|(?<=[\[,]))~[^],]*")


def with_homes(words: Sequence[str]) -> list[str]:
    """Overrides in which `~` is the user's home, as shells leave it in `input=~/image.png`.

    Raises:
        ConfigError: there is no such user.
    """
    return [_with_home(word) for word in words]


def _with_home(word: str) -> str:
    key, equals, value = word.partition("=")
    if not equals:
        return word
    if match := _QUOTED.fullmatch(value):
        return f"{key}={quoted(expanded(match[2]))}"
    return f"{key}={_LISTED.sub(lambda path: quoted(expanded(path[0])), value)}"


def expanded(path: str) -> str:
    """A path that begins with `~` or `~user`, from the root on.

    Raises:
        ConfigError: there is no such user.
    """
    try:
        return str(Path(path).expanduser())
    except RuntimeError as error:
        user = Path(path).parts[0]
        raise ConfigError(f"no folder of {user} for {path}; give the whole path") from error


def with_flags_first(words: Sequence[str]) -> list[str]:
    """The words with Hydra's own flags in front of overrides, as its parser takes no others.

    Raises:
        ConfigError: a flag is unknown, or lacks its value.
    """
    from hydra._internal.utils import get_args_parser

    parser = get_args_parser()
    parser.error = _refuse  # type: ignore[method-assign] # prints its usage and exits
    arguments, unknown = parser.parse_known_intermixed_args(list(words))
    if unknown:
        raise ConfigError(f"there is no option {unknown[0]}; --help shows those that there are")
    overrides = arguments.overrides
    return [*(word for word in words if word not in overrides), *overrides]


def _refuse(message: str) -> NoReturn:
    raise ConfigError(f"{message}; --help shows how commands are written")
