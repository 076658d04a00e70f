"""Errors whose message is one line for the user: the value, what was expected, how to fix it."""

from collections.abc import Mapping
from numbers import Real
from typing import Any


class SceneFWError(Exception):
    """Base of every error raised on purpose; the command line prints it and exits with 2."""


class IncompleteError(SceneFWError):
    """Part of the work could not be done; the rest is, and its figures are kept.

    Args:
        message: what could not.
        figures: of the rest.
    """

    def __init__(self, message: str, figures: Mapping[str, Any]) -> None:
        super().__init__(message)
        self.figures = dict(figures)


class InputError(SceneFWError):
    """Data from outside (an image, a folder, a mesh) is unusable as given."""


class EmptyImageError(InputError):
    """A depth image without a single measurement, as from a covered lens."""


class ConfigError(SceneFWError):
    """An option, a key or a combination of settings is wrong."""


class CheckpointError(SceneFWError):
    """A checkpoint is missing, truncated, of another version or for another task."""


class TrainingError(SceneFWError):
    """A training can't continue: its numbers are no longer finite."""


class StorageError(SceneFWError):
    """A file or folder can't be written or is damaged."""


class WorkerError(SceneFWError):
    """A process that did part of the work was lost."""


class MissingDependencyError(SceneFWError):
    """An optional library is needed for this; the message names the install line."""


def require_at_least(least: int, **settings: int | None) -> None:
    """Checks settings of a run before the work; None stands for no limit.

    Args:
        least: that each may be.
        settings: by name.

    Raises:
        ConfigError: one is below.
    """
    for name, value in settings.items():
        if value is not None and value < least:
            raise ConfigError(f"run.{name} is {value}; expected {least} or more")


def require_number(value: Any, name: str, expected: str) -> None:
    """Checks what Python code was given; None stands for a default.

    Raises:
        InputError: it is no number.
    """
    if value is not None and (isinstance(value, bool) or not isinstance(value, Real)):
        raise InputError(f"{name} is {value!r} ({type(value).__name__}); expected {expected}")
