"""The end of a run over several images, of which some may be unusable."""

import sys
from collections.abc import Mapping
from pathlib import Path

from scenefw.core.errors import IncompleteError, InputError


def require_some(failures: Mapping[Path, InputError], count: int) -> None:
    """Raises an InputError if none of so many images is usable."""
    if len(failures) < count:
        return
    image, error = next(iter(failures.items()))
    if count == 1:
        raise error
    raise InputError(f"none of {count} images is usable; the first, {image}: {error}")


def finished(
    figures: dict[str, float], failures: Mapping[Path, InputError], count: int
) -> dict[str, float]:
    """The figures of a run, with `images` and `failed`.

    Raises:
        IncompleteError: some images are unusable. A line for each is printed; the others are done.
    """
    figures = {"images": float(count), "failed": float(len(failures)), **figures}
    for image, reason in failures.items():
        print(f"skipped {image}: {reason}", file=sys.stderr)
    if failures:
        words = "is" if len(failures) == 1 else "are"
        raise IncompleteError(
            f"{len(failures)} of {count} images {words} unusable and skipped, see above; the "
            "others are done",
            figures,
        )
    return figures
