"""Provenance of weights: what a file says about its training and earlier ones."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenefw.core.types import GridSpec
from scenefw.learning.checkpoint import SHAPE_INSTANCE, read_header


@dataclass(frozen=True)
class Provenance:
    """The facts in a file of weights.

    Args:
        path: of the file.
        task: what the network is for.
        recipe: class and arguments of the network.
        grid: the voxel grid it was trained on; None for a network of images.
        omitted: parts of the network that only training needs, left out.
        versions: of the packages that wrote it.
        metadata: how it was trained.
        numbers: how many it holds.
        digest: SHA-256 of the file.
    """

    path: Path
    task: str
    recipe: Mapping[str, Any]
    grid: GridSpec | None
    omitted: tuple[str, ...]
    versions: Mapping[str, str]
    metadata: Mapping[str, Any]
    numbers: int
    digest: str

    @property
    def trainings(self) -> tuple[Mapping[str, Any], ...]:
        """Metadata of the training, and of each one whose weights the one before started from."""
        trainings = [self.metadata]
        while before := trainings[-1].get("started_from"):
            trainings.append(before)
        return tuple(trainings)


def read_provenance(path: Path | str) -> Provenance:
    """The facts in a file of weights.

    Raises:
        CheckpointError: it is missing, damaged or from elsewhere.
    """
    header, numbers = read_header(path)
    return Provenance(
        path=Path(path),
        task=header.get("task", SHAPE_INSTANCE),
        recipe=header["recipe"],
        grid=header["grid"],
        omitted=tuple(header.get("omitted", ())),
        versions=header["versions"],
        metadata=header["metadata"],
        numbers=numbers,
        digest=digest(Path(path)),
    )


def origin(path: Path | str) -> dict[str, Any]:
    """Metadata for a training that starts from a file of weights: its own, name and SHA-256.

    Raises:
        CheckpointError: it is missing, damaged or from elsewhere.
    """
    provenance = read_provenance(path)
    return {"file": provenance.path.name, "sha256": provenance.digest, **provenance.metadata}


def digest(path: Path) -> str:
    """SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
