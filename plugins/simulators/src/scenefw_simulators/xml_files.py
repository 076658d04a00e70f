"""Numbers and text of XML files."""

from collections.abc import Iterable
from xml.etree import ElementTree as ET


def numbers(values: Iterable[float]) -> str:
    """Numbers with nine digits, separated by spaces."""
    return " ".join(f"{float(value):.9g}" for value in values)


def rgba(colour: Iterable[float]) -> str:
    """An opaque colour, four numbers in [0, 1]."""
    return numbers([*colour, 1.0])


def xml_text(root: ET.Element) -> str:
    """The text of a file."""
    ET.indent(root)
    return f'<?xml version="1.0"?>\n{ET.tostring(root, encoding="unicode")}\n'
