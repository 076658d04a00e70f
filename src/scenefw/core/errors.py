"""Errors whose message is one line for the user: the value, what was expected, how to fix it."""

from collections.abc import Mapping
from numbers import Integral, Real
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


class LabelsError(InputError):
    """What a person said an image shows is unusable as given."""


class ConfigError(SceneFWError):
    """An option, a key or a combination of settings is wrong."""


class SettingError(ConfigError):
    """The value of one setting is out of its range.

    Args:
        name: of the argument; whoever knows its key in the config puts that in its place.
        value: as given.
        expected: the range in words.
    """

    def __init__(self, name: str, value: object, expected: str) -> None:
        super().__init__(name, value, expected)
        self.name, self.value, self.expected = name, value, expected

    def __str__(self) -> str:
        value = list(self.value) if isinstance(self.value, tuple) else self.value
        value = "null" if value is None else value
        return f"{self.name} = {value}: expected {self.expected}"


class CheckpointError(SceneFWError):
    """A checkpoint is missing, truncated, of another version or for another task."""


class TrainingError(SceneFWError):
    """A training can't continue: its numbers are no longer finite, or what computes them failed."""


class StorageError(SceneFWError):
    """A file or folder can't be written or is damaged."""


class WorkerError(SceneFWError):
    """A process that did part of the work was lost."""


class MissingDependencyError(SceneFWError):
    """An optional library is needed for this; the message names the install line."""


def require_number(value: Any, name: str, expected: str) -> None:
    """Checks what Python code was given; None stands for a default.

    Raises:
        InputError: it is no number.
    """
    if value is not None and (isinstance(value, bool) or not isinstance(value, Real)):
        raise InputError(f"{name} is {value!r} ({type(value).__name__}); expected {expected}")


def require_whole(value: Any, name: str, minimum: int = 0) -> None:
    """Checks a whole number that Python code was given.

    Raises:
        InputError: it is no whole number, or less than `minimum`.
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or int(value) < minimum:
        raise InputError(f"{name} is {value!r}; expected a whole number, {minimum} or more")
