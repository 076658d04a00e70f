"""Files of arrays by name, as numpy reads them."""

from __future__ import annotations

import zipfile
from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.core.files import replacing

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray


def write_arrays(path: Path, arrays: Mapping[str, NDArray[Any]], *, compact: bool = False) -> None:
    """An .npz file, at once or not at all; the same arrays give the same bytes.

    Args:
        path: of the file.
        arrays: by name.
        compact: a fifth smaller than numpy writes it; otherwise three times as fast.

    Raises:
        StorageError: the file can't be written.
    """
    method = zipfile.ZIP_LZMA if compact else zipfile.ZIP_DEFLATED
    with (
        replacing(path) as temporary,
        zipfile.ZipFile(temporary, "w", method, compresslevel=1) as file,  # 1: the fastest
    ):
        for name, value in arrays.items():
            with file.open(f"{name}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, np.asanyarray(value), allow_pickle=False)
