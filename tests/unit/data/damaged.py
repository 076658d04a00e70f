"""Archives of arrays that are damaged, or written in a way that numpy doesn't read."""

import io
import zipfile

import numpy as np


def _archive(content, **options):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", **options) as archive:
        for name, array in content.items():
            with archive.open(f"{name}.npy", "w") as entry:
                np.lib.format.write_array(entry, np.asarray(array), allow_pickle=True)
    return bytearray(file.getvalue())


def _headers(data, offsets, value):
    """Sets two bytes in the local and the central header of each entry."""
    for mark, offset in zip((b"PK\x03\x04", b"PK\x01\x02"), offsets, strict=True):
        at = data.find(mark)
        while at >= 0:
            data[at + offset : at + offset + 2] = value.to_bytes(2, "little")
            at = data.find(mark, at + 4)
    return data


def _scrambled(content):
    """What is in the entries is no longer a stream of zlib's."""
    data = _archive(content, compression=zipfile.ZIP_DEFLATED)
    at = data.find(b"PK\x03\x04")
    while at >= 0:
        name = int.from_bytes(data[at + 26 : at + 28], "little")
        extra = int.from_bytes(data[at + 28 : at + 30], "little")
        start = at + 30 + name + extra
        data[start : start + 8] = b"\xff" * 8
        at = data.find(b"PK\x03\x04", at + 4)
    return data


def _endless(content):
    """The header of each array asks for more memory than there is."""
    file = io.BytesIO()
    header = {"descr": "<f8", "fortran_order": False, "shape": (2**40, 2**18)}
    with zipfile.ZipFile(file, "w") as archive:
        for name in content:
            with archive.open(f"{name}.npy", "w") as entry:
                np.lib.format.write_array_header_1_0(entry, header)
    return file.getvalue()


def _pickled(content):
    return _archive({name: np.array([{}], dtype=object) for name in content})


KINDS = {
    "scrambled": _scrambled,
    "unknown compression": lambda content: _headers(_archive(content), (8, 10), 97),
    "encrypted": lambda content: _headers(_archive(content), (6, 8), 1),
    "endless": _endless,
    "cut": lambda content: _archive(content)[:-40],
    "no archive": lambda _: b"x" * 100,
    "pickled": _pickled,
}


def write(path, kind, content):
    """A damaged archive in place of one with this content."""
    path.write_bytes(bytes(KINDS[kind](content)))
    return path
