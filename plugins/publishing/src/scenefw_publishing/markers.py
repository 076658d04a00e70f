"""Parts of a document that commands write, between two comments."""

from pathlib import Path

from scenefw.core.errors import StorageError
from scenefw.core.files import write_text


def fill(document: Path, name: str, body: str) -> None:
    """Replaces only the text between `<!-- name -->` and `<!-- /name -->`.

    Raises:
        StorageError: the document is missing, can't be written, or hasn't the two comments once.
    """
    write_text(document, filled(read_document(document, name), document, name, body))


def read_document(document: Path, name: str) -> str:
    """The text of a document with the two comments; checked before the work.

    Raises:
        StorageError: as `fill`.
    """
    if not document.is_file():
        raise StorageError(f"no document at {document}; give another, or run where it lies")
    text = document.read_text(encoding="utf-8")
    filled(text, document, name, "")
    return text


def body(text: str, name: str) -> str:
    """What stands between the two comments of a text that has them (`read_document`)."""
    return text.split(f"<!-- {name} -->")[1].split(f"<!-- /{name} -->")[0].strip()


def filled(text: str, document: Path, name: str, body: str) -> str:
    """The text with another body between its two comments.

    Raises:
        StorageError: it hasn't each of them once, in this order.
    """
    first, last = f"<!-- {name} -->", f"<!-- /{name} -->"
    if text.count(first) != 1 or text.count(last) != 1 or text.index(first) > text.index(last):
        raise StorageError(
            f"{document} needs the lines {first} and {last} once each, in this order; what stands "
            "between them is replaced"
        )
    before, after = text.split(first)[0], text.split(last)[1]
    return f"{before}{first}\n{body.strip()}\n{last}{after}"
