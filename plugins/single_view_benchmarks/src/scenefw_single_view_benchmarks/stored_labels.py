"""Labels of images that their own files hold."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenefw.data.files.readers import read_labels

if TYPE_CHECKING:
    from pathlib import Path

    from scenefw.core.types import Int32


class StoredLabels:
    """Labels in the `.npz` of an image: `instances`, or `label` as `decode_labels` reads it."""

    hint = "expected an array `label` or `instances` in each .npz, or evaluation=outlined"

    def of(self, image: Path) -> Int32 | None:
        """Labels (H, W) of an image: -1 unknown, 0 no object, 1..N; None if it has none.

        Raises:
            InputError: the file is damaged.
        """
        return read_labels(image)
